#include "step/apart.h"

#include "base/check.h"
#include "mesh/query.h"

#include <stdlib.h>
#include <string.h>

#define NEAR_MM 4.0

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
static bool may_reach(const struct mesh *mesh, const uint32_t corners[3], struct box box,
                      double reach_mm) {
    vec3 a = mesh_vertex(mesh, corners[0]);
    double size = fmax(vec3_distance(a, mesh_vertex(mesh, corners[1])),
                       vec3_distance(a, mesh_vertex(mesh, corners[2])));
    vec3 low = vec3_sub(box.min, a), high = vec3_sub(a, box.max);
    double off = fmax(fmax(low.x, high.x), fmax(fmax(low.y, high.y), fmax(low.z, high.z)));
    return off <= size + reach_mm;
}

// Exact where it is within reach.
static double apart_within(const struct mesh *surface, const vec3 *points, uint32_t count,
                           double reach_mm) {
    struct box box = box_of(points, count);
    struct mesh near = *surface;
    double largest = 0;
    near.triangles = alloc(3 * (size_t)surface->triangle_count, sizeof *near.triangles);
    near.triangle_count = 0;
    for (uint32_t i = 0; i < surface->triangle_count; i++) {
        const uint32_t *corners = surface->triangles + 3 * (size_t)i;
        if (may_reach(surface, corners, box, reach_mm))
            memcpy(near.triangles + 3 * (size_t)near.triangle_count++, corners,
                   3 * sizeof *corners);
    }
    for (uint32_t i = 0; i < count; i++) {
        double nearest = INFINITY;
        for (uint32_t k = 0; k < near.triangle_count; k++) {
            struct closest closest;
            closest_on_triangle(&near, k, points[i], &closest);
            nearest = fmin(nearest, closest.distance);
        }
        largest = fmax(largest, nearest);
    }
    free(near.triangles);
    return largest;
}

double apart_mm(const struct mesh *surface, const vec3 *points, uint32_t count) {
    if (!count)
        return 0;
    double distance_mm = apart_within(surface, points, count, NEAR_MM);
    return distance_mm <= NEAR_MM ? distance_mm : apart_within(surface, points, count, INFINITY);
}
