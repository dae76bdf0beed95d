// A change of a triangle mesh whose vertices and triangles have ids, as bytes. PROTOCOL.md has the
// format. Millimetres, in the mesh's own frame.
//
// Numbers: the first mesh of a session has number 1, and each change makes the next one. A change
// is of the mesh `base`; base 0 is nothing, and the change then a whole mesh of any number. Ids are
// ascending in every list, each once, below MESH_DELTA_IDS_MAX.
//
// A vertex lives as long as a living triangle uses it; a change does not list vertices that are
// gone. A vertex never moves. A new vertex may get the id of one that is gone, in the same change
// too.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define MESH_DELTA_IDS_MAX (1u << 20)
#define MESH_DELTA_PIECES_MAX 64
#define MESH_DELTA_REACH_MM 10000.0f // no coordinate is farther from 0

struct delta_vertex {
    uint32_t id;
    float position[3];
};

struct delta_triangle {
    uint32_t id;
    uint32_t corners[3]; // vertex ids, distinct, counter-clockwise seen from outside
    uint32_t label;      // number of the cut that made its surface; 0: the original one
};

// A part that came off, for display only: it is not in the mesh.
struct delta_piece {
    float volume_mm3;
    float centroid[3];
    uint32_t vertex_count;
    uint32_t triangle_count;
    float *positions;    // 3 * vertex_count
    uint32_t *triangles; // 3 * triangle_count: vertex indices of the piece's own
};

struct mesh_delta {
    uint32_t base;
    uint32_t number; // of the mesh after it
    uint32_t freed_count;
    uint32_t *freed; // triangles that are gone
    uint32_t vertex_count;
    struct delta_vertex *vertices; // that are new
    uint32_t made_count;
    struct delta_triangle *made; // new ones, and living ones whose corners or label have changed
    uint32_t piece_count;
    struct delta_piece *pieces;
    uint64_t hash; // of the whole mesh after it (wire/tissue.h)
};

void mesh_delta_fini(struct mesh_delta *delta); // frees all arrays; a zeroed delta is fine

// RESULT_FORMAT or RESULT_LIMIT if the number is not above its base, ids are too high or not
// ascending, corners are not distinct, coordinates are not finite or out of reach, a piece's index
// is not below its number of vertices, or there are too many pieces. The error names the place.
enum result mesh_delta_validate(const struct mesh_delta *delta, struct error *err);

// Encodes a valid change into `data`; the bytes used are at most mesh_delta_bound.
size_t mesh_delta_bound(const struct mesh_delta *delta);
size_t mesh_delta_encode(const struct mesh_delta *delta, uint8_t *data, size_t size);

// Decodes the change at the start of `data`, which takes *out_used bytes; others may follow. Errors
// are those of mesh_delta_validate, and RESULT_FORMAT if the bytes are no change; *out_delta is
// then zeroed. Takes memory in proportion to `size`. The caller releases the delta.
enum result mesh_delta_decode(const uint8_t *data, size_t size, size_t *out_used,
                              struct mesh_delta *out_delta, struct error *err);
