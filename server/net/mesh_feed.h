// The mesh of one surface group of one session, and the payloads that bring stations up to date. A
// payload has the changes that the station lacks. It has the whole mesh if these changes are no
// longer kept or would not be shorter. One thread at a time.
//
// One payload is on its way to a station at a time. Changes in the meantime go together in the next
// one, once the station has acknowledged the one before. A slow station gets fewer and larger
// payloads, and no queue grows.
#pragma once

#include "net/mesh_payload.h"
#include "wire/tissue.h"
#include "wire/wire.h"

struct mesh_feed;

// whole: the first mesh, in its fields vertices and made; its number, or 1 if that is 0. Other
// fields are not read. RESULT_INVALID and RESULT_LIMIT name its fault. The caller destroys the
// feed.
enum result mesh_feed_create(const char *group, const struct mesh_delta *whole,
                             struct mesh_feed **out_feed, struct error *err);
// A feed that begins with the mesh of another one, which must not change and must outlive it. It
// costs nothing to speak of until its first change.
struct mesh_feed *mesh_feed_share(const struct mesh_feed *start);
void mesh_feed_destroy(struct mesh_feed **feed); // payloads live on; NULL inside is fine

// The mesh has changed, and gets the next number. Reads freed, vertices, made and pieces of
// `change`. RESULT_INVALID and RESULT_LIMIT as in tissue_change and mesh_delta.h; the feed cannot
// be used afterwards.
enum result mesh_feed_push(struct mesh_feed *feed, const struct mesh_delta *change,
                           struct error *err);

const struct tissue *mesh_feed_tissue(const struct mesh_feed *feed); // number, hash, the mesh

// The state of one station's mesh of one group. A zeroed cursor gets nothing, because the station
// has not asked. Zero it when the connection ends. If another feed replaces this one while the
// station stays, set it to {.asked = true}.
struct mesh_cursor {
    bool asked;
    uint32_t number; // of the mesh that the station acknowledged; 0: none
    uint64_t hash;
    uint32_t sent; // the number after the payload on its way; 0: none is on its way
};

void mesh_cursor_ask(struct mesh_cursor *cursor, const char *group, const arthron_MeshAsk *ask);
void mesh_cursor_ack(struct mesh_cursor *cursor, const arthron_MeshState *ack);

// The payload to send now, as a reference for the caller. Call it after each push, ask and ack.
// NULL: the station is up to date, has not asked, or has not acknowledged the last payload.
struct mesh_payload *mesh_feed_next(struct mesh_feed *feed, struct mesh_cursor *cursor);
