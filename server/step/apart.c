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
static bool may_reach(const struct mesh *mesh, const uint32_t corners[3], struct box box) {
    vec3 a = mesh_vertex(mesh, corners[0]), b = mesh_vertex(mesh, corners[1]);
    vec3 c = mesh_vertex(mesh, corners[2]);
    return !((a.x < box.min.x && b.x < box.min.x && c.x < box.min.x) ||
             (a.y < box.min.y && b.y < box.min.y && c.y < box.min.y) ||
             (a.z < box.min.z && b.z < box.min.z && c.z < box.min.z) ||
             (a.x > box.max.x && b.x > box.max.x && c.x > box.max.x) ||
             (a.y > box.max.y && b.y > box.max.y && c.y > box.max.y) ||
             (a.z > box.max.z && b.z > box.max.z && c.z > box.max.z));
}

static void gather(const struct mesh *surface, struct box box, struct mesh *out_near) {
    *out_near = *surface;
    out_near->triangles = alloc(3 * (size_t)surface->triangle_count, sizeof *out_near->triangles);
    out_near->triangle_count = 0;
    for (uint32_t i = 0; i < surface->triangle_count; i++) {
        const uint32_t *corners = surface->triangles + 3 * (size_t)i;
        if (may_reach(surface, corners, box))
            memcpy(out_near->triangles + 3 * (size_t)out_near->triangle_count++, corners,
                   3 * sizeof *corners);
    }
}

// The distance of the point, or any that is not above `enough`. *hint: the triangle to begin with,
// then the one that was nearest.
static double distance_from(const struct mesh *mesh, vec3 p, double enough, uint32_t *hint) {
    double nearest = INFINITY;
    for (uint32_t k = 0, first = *hint; k < mesh->triangle_count && nearest > enough; k++) {
        struct closest closest;
        uint32_t t =
            k + first < mesh->triangle_count ? k + first : k + first - mesh->triangle_count;
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
