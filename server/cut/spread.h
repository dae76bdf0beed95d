// Connected parts of a surface.
#pragma once

#include "cut/cut_mesh.h"

// Appends to `list` the triangle and all others that are reached from it over sides, in the order
// in which they are reached: those for which `belongs` is true and that `seen` does not hold. It
// then holds them.
void spread(const struct cut_mesh *mesh,
            bool (*belongs)(const struct cut_mesh *mesh, uint32_t triangle),
            struct stamped_set *seen, struct ids *list, uint32_t triangle);
