// Changes of a few triangles that keep the mesh closed, manifold and oriented.
#pragma once

#include "cut/cut_mesh.h"

// Merges the start of a side into its end: both triangles of the side go.
bool surgery_can_merge(const struct cut_mesh *mesh, uint32_t side);
void surgery_merge(struct cut_mesh *mesh, uint32_t side);

// Turns a side into the other diagonal of its two triangles. Both get the label of the triangle
// across.
bool surgery_can_flip(const struct cut_mesh *mesh, uint32_t side);
void surgery_flip(struct cut_mesh *mesh, uint32_t side);
