// How far points are from a surface.
#pragma once

#include "mesh/mesh.h"

// The largest distance of the points to the surface, in mm; 0 without points.
double apart_mm(const struct mesh *surface, const vec3 *points, uint32_t count);
