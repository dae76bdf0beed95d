#include "scene/brute.h"

typedef struct wide {
    long double x, y, z;
} wide;

static wide wide_sub(vec3 a, vec3 b) {
    return (wide){(long double)a.x - b.x, (long double)a.y - b.y, (long double)a.z - b.z};
}

static long double wide_dot(wide a, wide b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static wide wide_cross(wide a, wide b) {
    return (wide){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static long double wide_length(wide a) {
    return sqrtl(wide_dot(a, a));
}

static long double to_side(vec3 p, vec3 from, vec3 to) {
    wide side = wide_sub(to, from), off = wide_sub(p, from), back = wide_sub(p, to);
    if (wide_dot(side, off) <= 0)
        return wide_length(off);
    if (wide_dot(side, back) >= 0)
        return wide_length(back);
    return wide_length(wide_cross(side, off)) / wide_length(side);
}

static long double to_triangle(vec3 p, const vec3 corner[3]) {
    wide normal = wide_cross(wide_sub(corner[1], corner[0]), wide_sub(corner[2], corner[0]));
    long double area = wide_length(normal), best = INFINITY;
    bool inside = area > 1e-12L;
    for (int i = 0; i < 3; i++) {
        vec3 from = corner[i], to = corner[(i + 1) % 3];
        best = fminl(best, to_side(p, from, to));
        wide inward = wide_cross(normal, wide_sub(to, from));
        inside = inside && wide_dot(inward, wide_sub(p, from)) >= 0;
    }
    return inside ? fminl(best, fabsl(wide_dot(normal, wide_sub(p, corner[0]))) / area) : best;
}

double brute_triangle(vec3 p, const vec3 corners[3]) {
    return (double)to_triangle(p, corners);
}

double brute_distance(const struct mesh *mesh, vec3 p) {
    long double best = INFINITY;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 corner[3] = {mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1),
                          mesh_corner(mesh, t, 2)};
        best = fminl(best, to_triangle(p, corner));
    }
    return (double)best;
}
