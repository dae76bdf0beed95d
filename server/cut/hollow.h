// Cavities: parts of the surface that enclose what is not there, connected to nothing else.
#pragma once

#include "cut/cut_mesh.h"

// Appends the triangles of all cavities inside the closed surface that `triangles` are. Costs a
// walk over the mesh. seen: scratch.
void hollow_append(const struct cut_mesh *mesh, struct stamped_set *seen, struct ids *triangles);
