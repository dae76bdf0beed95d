// Whether a static mesh hides one point from another (Embree behind this header).
//
// Double precision decides for each triangle, and Embree only finds those that might be in the way,
// so the answer is the same on every CPU. Any number of threads may ask one sight at once. Asking
// allocates nothing.
#pragma once

#include "mesh/mesh.h"

struct sight;

// The sight keeps a pointer to the mesh, which must outlive it unchanged and pass mesh_validate.
// RESULT_IO where Embree cannot build. The caller destroys it.
enum result sight_create(const struct mesh *mesh, struct sight **out_sight, struct error *err);
void sight_destroy(struct sight **sight); // NULL inside is fine; *sight becomes NULL

// Whether no triangle crosses the straight way from one point to the other. What crosses it in the
// last spare_mm does not count. Both in the mesh's frame, finite. The hint is any triangle of the
// mesh: it is tried first, so an answer near the last one is cheap, and becomes one that crosses.
bool sight_is_clear(const struct sight *sight, vec3 from, vec3 to, double spare_mm, uint32_t *hint);
