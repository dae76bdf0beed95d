// The winding number of a mesh around a point, by a vertical ray.
#pragma once

#include "cut/cut_mesh.h"

// slots and hits: scratch.
int ray_winding(const struct cut_mesh *mesh, struct stamped_set *slots, struct ids *hits,
                vec3 point);

// Of a closed part of it.
int ray_winding_of(const struct cut_mesh *mesh, const uint32_t *triangles, uint32_t count,
                   vec3 point);
