#include "apart.h"

#include "mesh/query.h"

#include <math.h>

#define POINT_MM2 0.01
#define POINTS_MAX 400 // of one triangle
#define FILM_MM 0.15

static vec3 normal_of(const struct mesh *mesh, uint32_t t, double *out_area) {
    vec3 a = mesh_corner(mesh, t, 0);
    vec3 area2 =
        vec3_cross(vec3_sub(mesh_corner(mesh, t, 1), a), vec3_sub(mesh_corner(mesh, t, 2), a));
    *out_area = vec3_length(area2) / 2;
    return vec3_unit_or(area2, (vec3){0});
}

// From the middle of a film its other side is as near.
static bool is_film(const struct mesh *mesh, const struct query *query, vec3 p, vec3 normal) {
    struct closest closest;
    double area;
    vec3 inside = vec3_add_scaled(p, -FILM_MM / 2, normal);
    query_closest(query, inside, INFINITY, MESH_NONE, &closest);
    return closest.distance < FILM_MM / 2 &&
           vec3_dot(normal, normal_of(mesh, closest.triangle, &area)) < -0.3;
}

// The middles of n² small triangles.
static void add_triangle(const struct mesh *from, uint32_t t, const struct query *own,
                         const struct query *to, struct samples *out) {
    double area;
    vec3 normal = normal_of(from, t, &area), a = mesh_corner(from, t, 0);
    vec3 ab = vec3_sub(mesh_corner(from, t, 1), a), ac = vec3_sub(mesh_corner(from, t, 2), a);
    int n = (int)ceil(sqrt(fmin(area / POINT_MM2, POINTS_MAX)));
    if (area < POINT_MM2 / 8)
        return;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 2 * (n - i) - 1; k++) {
            double u = (i + (k % 2 ? 2.0 : 1.0) / 3) / n, v = (k / 2 + (k % 2 ? 2.0 : 1.0) / 3) / n;
            vec3 p = vec3_add_scaled(vec3_add_scaled(a, u, ab), v, ac);
            struct closest closest;
            if (is_film(from, own, p, normal))
                continue;
            query_closest(to, p, INFINITY, MESH_NONE, &closest);
            samples_add(out, closest.distance);
        }
}

enum result apart_distances(const struct mesh *from, const bool *fresh, const struct mesh *to,
                            struct samples *out, struct error *err) {
    struct query *own = NULL, *other = NULL;
    enum result result = query_create(from, &own, err);
    if (result == RESULT_OK)
        result = query_create(to, &other, err);
    for (uint32_t t = 0; result == RESULT_OK && t < from->triangle_count; t++)
        if (fresh[t])
            add_triangle(from, t, own, other, out);
    query_destroy(&own);
    query_destroy(&other);
    return result;
}
