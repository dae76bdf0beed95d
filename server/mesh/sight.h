// Whether static meshes hide one point from another (Embree behind this header).
//
// Double precision decides for each triangle, and Embree only finds those that might be in the way,
// so the answer is the same on every CPU. Any number of threads may ask one sight at once. Asking
// allocates nothing.
#pragma once

#include "mesh/mesh.h"

#define SIGHT_MESHES_MAX 32

struct sight;

// Of the meshes whose bits are set in `which`. The sight keeps pointers to them; they must outlive
// it unchanged and pass mesh_validate. RESULT_IO where Embree cannot build. The caller destroys it.
enum result sight_create(const struct mesh *meshes, uint32_t which, struct sight **out_sight,
                         struct error *err);
void sight_destroy(struct sight **sight); // NULL inside is fine; *sight becomes NULL

// A triangle that lay in between, of a mesh by its index.
struct sight_hint {
    uint32_t mesh, triangle;
};

// Whether no triangle of the meshes in `which` crosses the straight way from one point to the
// other. What crosses it in the last spare_mm does not count. Both in the meshes' frame, finite.
// The hint is tried first, so an answer near the last one is cheap. It becomes a triangle that
// crosses. Zeroed, or of another sight of the same meshes, it changes nothing.
bool sight_is_clear(const struct sight *sight, uint32_t which, vec3 from, vec3 to, double spare_mm,
                    struct sight_hint *hint);
