// What a station said about its meshes, from the control thread to the cut worker. It keeps only
// what still counts, so there is always room.
#pragma once

#include "base/bucket.h"
#include "net/control.h"
#include "step/job.h"

#include <pthread.h>

// In this order. left, peer: of a station, not of a page.
struct mesh_words {
    bool left; // the connection before this one has ended
    struct control_peer peer;
    bool asks;
    arthron_MeshAsk ask;
    int ack_count;
    arthron_MeshState acks[TISSUES_MAX];
};

void mesh_words_ask(struct mesh_words *words, const arthron_MeshAsk *ask); // replaces all before it
// Replaces that of the same group. Of more groups than a case has tissues, the oldest is dropped.
void mesh_words_ack(struct mesh_words *words, const arthron_MeshState *ack);

struct mesh_inbox {
    pthread_mutex_t lock; // held for copies only
    bool filled;
    struct bucket asks; // so that no station keeps the cut worker busy with whole meshes
    struct mesh_words words;
};

void mesh_inbox_init(struct mesh_inbox *inbox);
void mesh_inbox_fini(struct mesh_inbox *inbox);

// message: a MeshAsk or mesh_ack.
void mesh_inbox_put(struct mesh_inbox *inbox, struct control_peer peer,
                    const arthron_Control *message);
void mesh_inbox_leave(struct mesh_inbox *inbox); // the station has gone

// False if there is nothing new, or only another ask too soon: that waits, or the next one does.
bool mesh_inbox_take(struct mesh_inbox *inbox, int64_t now_ns, struct mesh_words *out_words);
