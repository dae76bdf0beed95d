// Cavities: parts of the surface that enclose what is not there, connected to nothing else.
#pragma once

#include "cut/tissue.h"

// Appends the triangles of all cavities inside the closed surface that `triangles` are. Costs a
// walk over the mesh. marks: scratch.
void hollow_append(const struct cut_mesh *mesh, struct marks *marks, struct ids *triangles);
