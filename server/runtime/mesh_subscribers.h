// The pages that follow the meshes of one station, beside the station itself. The cut worker owns
// this list.
#pragma once

#include "net/mesh_feed.h"
#include "runtime/mailbox.h"

#define MESH_SUBSCRIBERS_MAX 16 // of one station

// A page's MeshAsk or mesh_ack, as a station sends them (PROTOCOL.md).
struct mesh_request {
    int station;
    uint64_t session; // serial of the page's session; a request for another session is dropped
    struct mailbox *mailbox; // a reference; the receiver of the request releases it
    bool asks;               // else it acknowledges
    union {
        arthron_MeshAsk ask;
        arthron_MeshState ack;
    };
};

struct mesh_subscribers {
    struct mesh_subscriber {
        struct mailbox *mailbox; // NULL: free
        struct mesh_cursor cursors[TISSUES_MAX];
    } all[MESH_SUBSCRIBERS_MAX];
};

// A session has ended: pages have to ask again for the meshes of the next one.
void mesh_subscribers_forget(struct mesh_subscribers *subscribers);
void mesh_subscribers_fini(struct mesh_subscribers *subscribers);

// groups: the names of the session's tissues. Where the list is full, a new page gets no meshes.
void mesh_subscribers_take(struct mesh_subscribers *subscribers, const struct mesh_request *request,
                           const char *const groups[TISSUES_MAX], int count);

// Puts into each mailbox what its page lacks and can take now. feeds: or NULL inside.
void mesh_subscribers_serve(struct mesh_subscribers *subscribers, uint64_t session,
                            struct mesh_feed *const feeds[TISSUES_MAX]);
