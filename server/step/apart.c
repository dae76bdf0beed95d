#include "step/apart.h"

#include "base/check.h"
#include "mesh/query.h"

#include <stdlib.h>
#include <string.h>

static struct box box_of(const vec3 *points, uint32_t count) {
    struct box box = {points[0], points[0]};
    for (uint32_t i = 1; i < count; i++) {
        vec3 p = points[i];
        box.min = (vec3){fmin(box.min.x, p.x), fmin(box.min.y, p.y), fmin(box.min.z, p.z)};
        box.max = (vec3){fmax(box.max.x, p.x), fmax(box.max.y, p.y), fmax(box.max.z, p.z)};
    }
    return box;
}

// Whether a triangle may come within reach of the box: false only where it does not.
static bool may_reach(const struct mesh *mesh, const uint32_t corners[3], const float min[3],
                      const float max[3]) {
    const float *a = mesh->positions + 3 * (size_t)corners[0];
    const float *b = mesh->positions + 3 * (size_t)corners[1];
    const float *c = mesh->positions + 3 * (size_t)corners[2];
    for (int i = 0; i < 3; i++)
        if ((a[i] < min[i] && b[i] < min[i] && c[i] < min[i]) ||
            (a[i] > max[i] && b[i] > max[i] && c[i] > max[i]))
            return false;
    return true;
}

static void gather(const struct mesh *surface, struct box box, struct mesh *out_near) {
    // No float lies between a number and what it is rounded to.
    const float min[] = {(float)box.min.x, (float)box.min.y, (float)box.min.z};
    const float max[] = {(float)box.max.x, (float)box.max.y, (float)box.max.z};
    *out_near = *surface;
    out_near->triangles = alloc(3 * (size_t)surface->triangle_count, sizeof *out_near->triangles);
    out_near->triangle_count = 0;
    for (uint32_t i = 0; i < surface->triangle_count; i++) {
        const uint32_t *corners = surface->triangles + 3 * (size_t)i;
        if (may_reach(surface, corners, min, max))
            memcpy(out_near->triangles + 3 * (size_t)out_near->triangle_count++, corners,
                   3 * sizeof *corners);
    }
}

// Not above the distance of any point of the triangle.
static double distance_of_box(const struct mesh *mesh, uint32_t triangle, vec3 p) {
    vec3 a = mesh_corner(mesh, triangle, 0), b = mesh_corner(mesh, triangle, 1);
    vec3 c = mesh_corner(mesh, triangle, 2);
    double x = higher(lower(lower(a.x, b.x), c.x) - p.x, p.x - higher(higher(a.x, b.x), c.x));
    double y = higher(lower(lower(a.y, b.y), c.y) - p.y, p.y - higher(higher(a.y, b.y), c.y));
    double z = higher(lower(lower(a.z, b.z), c.z) - p.z, p.z - higher(higher(a.z, b.z), c.z));
    return higher(x, higher(y, z));
}

// The distance of the point, or any that is not above `enough`. *hint: the triangle to begin with,
// then the one that was nearest.
static double distance_from(const struct mesh *mesh, vec3 p, double enough, uint32_t *hint) {
    double nearest = INFINITY;
    for (uint32_t k = 0, first = *hint; k < mesh->triangle_count && nearest > enough; k++) {
        struct closest closest;
        uint32_t t =
            k + first < mesh->triangle_count ? k + first : k + first - mesh->triangle_count;
        if (distance_of_box(mesh, t, p) > nearest)
            continue;
        closest_on_triangle(mesh, t, p, &closest);
        if (closest.distance < nearest) {
            nearest = closest.distance;
            *hint = t;
        }
    }
    return nearest;
}

// Exact where it is within reach.
static double apart_within(const struct mesh *surface, const vec3 *points, uint32_t count,
                           double reach_mm) {
    struct box box = box_of(points, count);
    vec3 reach = {reach_mm, reach_mm, reach_mm};
    struct mesh near;
    double largest = 0;
    uint32_t hint = 0;
    gather(surface, (struct box){vec3_sub(box.min, reach), vec3_add(box.max, reach)}, &near);
    for (uint32_t i = 0; i < count; i++)
        largest = fmax(largest, distance_from(&near, points[i], largest, &hint));
    free(near.triangles);
    return largest;
}

double apart_mm(const struct mesh *surface, const vec3 *points, uint32_t count) {
    static const double reaches_mm[] = {0.5, 4, INFINITY};
    double distance_mm = 0;
    for (int i = 0; count && i < 3; i++) {
        distance_mm = apart_within(surface, points, count, reaches_mm[i]);
        if (distance_mm <= reaches_mm[i])
            break;
    }
    return distance_mm;
}
