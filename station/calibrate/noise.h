// How much a measured point trembles, whether it moves or not.
#pragma once

#include "base/pose.h"

// Standard deviation along one axis, in mm: root mean square of the second differences, which
// remove any steady motion, by √6, which is what independent noise makes of them. The points are
// evenly spaced in time. 0 for fewer than three.
double noise_of_points(const vec3 *points, int count);
