// The pages that follow the meshes of one station, beside the station itself. The cut worker owns
// this list.
#pragma once

#include "net/mesh_feed.h"
#include "runtime/mailbox.h"
#include "runtime/mesh_inbox.h"
#include "runtime/mismatch_feed.h"

#define MESH_SUBSCRIBERS_MAX 16 // of one station

// What a page said about its meshes, as a station does (PROTOCOL.md).
struct mesh_request {
    int station;
    uint64_t session; // serial of the page's session; a request for another session is dropped
    struct mailbox *mailbox; // a reference; the receiver of the request releases it
    bool mismatch;           // is to come with the meshes
    struct mesh_words words;
};

struct mesh_subscribers {
    struct mesh_subscriber {
        struct mailbox *mailbox; // NULL: free
        bool mismatch;
        struct mesh_cursor cursors[TISSUES_MAX];
    } all[MESH_SUBSCRIBERS_MAX];
};

// A session has ended: pages have to ask again for the meshes of the next one.
void mesh_subscribers_forget(struct mesh_subscribers *subscribers);
void mesh_subscribers_fini(struct mesh_subscribers *subscribers);

// groups: the names of the session's tissues. Where the list is full, a new page gets no meshes.
void mesh_subscribers_take(struct mesh_subscribers *subscribers, const struct mesh_request *request,
                           const char *const groups[TISSUES_MAX], int count);

// What pages get: of a session, its meshes and how they differ from the touch.
struct mesh_offer {
    uint64_t session; // serial
    const struct operation *operation;
    struct mesh_feed *const *feeds; // TISSUES_MAX, or NULL inside
    struct mismatch_feed *mismatch;
};

// Puts into each mailbox what its page lacks and can take now.
void mesh_subscribers_serve(struct mesh_subscribers *subscribers, const struct mesh_offer *offer);
