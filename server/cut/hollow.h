// Cavities: closed parts of the surface that face inwards.
#pragma once

#include "cut/cut_mesh.h"

// Appends the triangles of all cavities inside the closed surface that `triangles` are. Walks over
// the whole mesh. seen: scratch.
void hollow_append(const struct cut_mesh *mesh, struct stamped_set *seen, struct ids *triangles);
