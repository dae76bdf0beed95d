// The mesh of one surface group of one session as its stations follow it, and which bytes bring
// which station up to date: the changes that it lacks, or the whole mesh where they are no longer
// kept or would not be shorter. One thread at a time.
//
// One payload is on its way to a station at a time: what changes meanwhile goes together in the
// next, once the station has said that it has the one before. A slow station gets fewer and larger
// payloads, and no queue grows.
#pragma once

#include "net/mesh_payload.h"
#include "wire/tissue.h"
#include "wire/wire.h"

struct mesh_feed;

// whole: the mesh to begin with, in vertices and made; it gets its number, or 1 where that is 0.
// Its other fields are not read. RESULT_INVALID and RESULT_LIMIT say where it is none. The caller
// destroys the feed.
enum result mesh_feed_create(const char *group, const struct mesh_delta *whole,
                             struct mesh_feed **out_feed, struct error *err);
void mesh_feed_destroy(struct mesh_feed **feed); // payloads live on; NULL inside is fine

// The mesh has changed: freed, vertices, made and pieces of `change` are read, and it gets the next
// number. RESULT_INVALID and RESULT_LIMIT as tissue_change and mesh_delta.h say: the feed is then
// of no more use.
enum result mesh_feed_push(struct mesh_feed *feed, const struct mesh_delta *change,
                           struct error *err);

const struct tissue *mesh_feed_tissue(const struct mesh_feed *feed); // number, hash, the mesh

// What one station has of one group. Zeroed: it has not asked yet, and gets nothing. Zero it when
// its connection ends. Where another feed takes the place of this one while the station stays, it
// has nothing of that: {.asked = true}.
struct mesh_cursor {
    bool asked;
    uint32_t number; // what the station said that it has; 0: nothing
    uint64_t hash;
    uint32_t sent; // the number that it will have; 0: nothing is on its way
};

void mesh_cursor_ask(struct mesh_cursor *cursor, const char *group, const arthron_MeshAsk *ask);
void mesh_cursor_ack(struct mesh_cursor *cursor, const arthron_MeshState *ack);

// What to send now; call it after each push, ask and ack. The caller's reference. NULL: nothing,
// because the station has all, has not asked, or has not yet acknowledged the last.
struct mesh_payload *mesh_feed_next(struct mesh_feed *feed, struct mesh_cursor *cursor);
