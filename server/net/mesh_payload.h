// Encoded changes of a mesh on their way to stations. A payload is made once and never changes. All
// connections that send it share it. Thread-safe.
#pragma once

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#define MESH_GROUP_MAX 64

struct mesh_payload {
    atomic_int references;
    char group[MESH_GROUP_MAX];
    uint32_t base, number; // as in arthron_MeshChunk
    uint64_t hash;         // of the bytes
    size_t size;
    size_t mismatch_size; // of the bytes, at their end: as in arthron_MeshChunk
    uint8_t bytes[];
};

// A payload with `size` undefined bytes and one reference, the caller's. Fill in the bytes, then
// call mesh_payload_seal.
struct mesh_payload *mesh_payload_create(const char *group, uint32_t base, uint32_t number,
                                         size_t size);
void mesh_payload_seal(struct mesh_payload *payload); // sets the hash

// Another payload: the first one's changes, with the mismatch behind them. Sealed; the reference is
// the caller's.
struct mesh_payload *mesh_payload_with_mismatch(const struct mesh_payload *changes,
                                                const uint8_t *mismatch, size_t size);

struct mesh_payload *mesh_payload_hold(struct mesh_payload *payload); // one reference more
void mesh_payload_release(struct mesh_payload **payload); // one less; NULL inside is fine
