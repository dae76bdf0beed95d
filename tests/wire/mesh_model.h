// A mesh with ids as a plain table, which counts and hashes everything anew: what changes on the
// wire are compared with.
#pragma once

#include "random.h"
#include "wire/tissue.h"

#define MODEL_IDS 300

struct model {
    bool alive[MODEL_IDS]; // triangles
    uint32_t corners[MODEL_IDS][3], labels[MODEL_IDS];
    float positions[MODEL_IDS][3];
};

uint64_t model_hash(const struct model *model);
void model_assert_same(const struct tissue *tissue, const struct model *model);

// A random change of about that share of the mesh, with which the model has changed already: freed,
// re-made and new triangles, new vertices some of which have the ids of others that go, pieces. The
// caller releases it.
struct mesh_delta model_change(struct model *model, struct random *random, double share,
                               uint32_t base);

struct mesh_bytes {
    uint8_t *data; // memory of just its size; the caller frees it
    size_t size;
};

struct mesh_bytes mesh_bytes_of(const struct mesh_delta *delta);
