// Points of a plane in two coordinates.
#pragma once

#include "base/pose.h"

struct flat_point {
    double x, y;
};

struct flat {
    vec3 origin, x, y;
};

// x and y counter-clockwise seen from where the normal points to. A normal without length gives
// some plane.
static inline struct flat flat_on(vec3 normal, vec3 origin) {
    vec3 n = vec3_unit_or(normal, (vec3){0, 0, 1});
    vec3 across = fabs(n.x) < 0.6 ? (vec3){1, 0, 0} : (vec3){0, 1, 0};
    vec3 x = vec3_unit_or(vec3_cross(across, n), (vec3){1, 0, 0});
    return (struct flat){origin, x, vec3_cross(n, x)};
}

static inline struct flat_point flat_of(const struct flat *flat, vec3 p) {
    vec3 d = vec3_sub(p, flat->origin);
    return (struct flat_point){vec3_dot(d, flat->x), vec3_dot(d, flat->y)};
}

// Twice the signed area of the triangle.
static inline double flat_cross(struct flat_point a, struct flat_point b, struct flat_point c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}
