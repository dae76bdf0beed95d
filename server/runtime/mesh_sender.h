// The meshes of one station's session on their way to the station and to the pages that follow it.
// All by the cut worker.
#pragma once

#include "net/control.h"
#include "runtime/mesh_inbox.h"
#include "runtime/mesh_starts.h"
#include "runtime/mesh_subscribers.h"
#include "runtime/types.h"

struct mesh_sender {
    struct control *control;
    struct control_peer peer;
    const struct session_runtime *session; // NULL: none
    struct mesh_feed *feeds[TISSUES_MAX];
    struct mesh_cursor cursors[TISSUES_MAX]; // of the station
    struct mesh_subscribers subscribers;
    struct mismatch_feed mismatch;
};

void mesh_sender_open(struct mesh_sender *sender, struct control *control,
                      const struct session_runtime *session, struct mesh_starts *starts);
void mesh_sender_close(struct mesh_sender *sender);
void mesh_sender_fini(struct mesh_sender *sender);

// A job has changed, or did not change, the operation's mesh; result->change is still as the job
// left it.
void mesh_sender_push(struct mesh_sender *sender, const struct job_result *result);

void mesh_sender_take(struct mesh_sender *sender, const struct mesh_words *words);
void mesh_sender_request(struct mesh_sender *sender, const struct mesh_request *request);

// Of the mesh as stations follow it; 0 where it cannot be sent.
uint64_t mesh_sender_hash(const struct mesh_sender *sender, int tissue);
