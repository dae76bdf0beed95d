// The volume of a difference by someone else's Boolean: CGAL's corefinement (exact predicates).
#pragma once

#include "cutting/surface.h"

// The volume (mm³) of what is left of the surface, pieces among it; false where CGAL refuses, as it
// does surfaces that run through themselves.
bool corefine_difference(const struct snapshot *surface, const struct convex *blade,
                         double *out_volume);
