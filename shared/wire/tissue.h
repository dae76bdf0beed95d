// A mesh that is updated by changes (wire/mesh_delta.h). The server and each receiver apply the
// same changes to their own tissue, and get equal hashes.
//
// Hash: the sum, modulo 2^64, of XXH3-64 over the record of each living vertex (u32 id, its three
// float's bits as u32) and over that of each living triangle (u32 id, 3 * u32 vertex id, u32
// label), little-endian. So updating the hash costs in proportion to the change. A mesh without
// triangles has hash 0.
#pragma once

#include "wire/mesh_delta.h"

struct tissue {
    uint32_t number; // 0: nothing yet
    uint64_t hash;
    uint32_t vertex_count;   // living
    uint32_t triangle_count; // living
    uint32_t vertex_bound;   // above every id, of the living and the dead
    uint32_t triangle_bound;
    float *positions;  // 3 * vertex_bound
    uint32_t *uses;    // vertex_bound: number of living triangles with this vertex; 0: dead
    uint32_t *corners; // 3 * triangle_bound: vertex ids; three times 0: dead
    uint32_t *labels;  // triangle_bound
};

void tissue_fini(struct tissue *tissue); // also for a zeroed one; zeroes it
void tissue_copy(struct tissue *out_tissue, const struct tissue *tissue);

static inline bool tissue_triangle_alive(const struct tissue *tissue, uint32_t triangle) {
    return triangle < tissue->triangle_bound &&
           tissue->corners[3 * (size_t)triangle] != tissue->corners[3 * (size_t)triangle + 1];
}

// Makes one valid change, without a check of delta->hash. Errors:
//   RESULT_MISSING  its base is not the tissue's number; the tissue is unchanged
//   RESULT_INVALID  it frees a dead triangle, gives a living vertex's id to a new vertex, adds a
//                   vertex without a triangle, or a triangle has a dead corner; the tissue is empty
enum result tissue_change(struct tissue *tissue, const struct mesh_delta *delta, struct error *err);

// Makes the encoded changes in `data`, one after the other. Errors are those of mesh_delta_decode
// and tissue_change, and RESULT_CORRUPT if a hash is not the mesh's. After any but RESULT_MISSING
// the tissue is empty.
enum result tissue_apply(struct tissue *tissue, const uint8_t *data, size_t size,
                         struct error *err);

// MeshChunk.hash: of all the bytes of a payload.
uint64_t tissue_payload_hash(const uint8_t *data, size_t size);

// The whole mesh as a change of nothing. The caller releases it.
void tissue_whole(const struct tissue *tissue, struct mesh_delta *out_delta);
