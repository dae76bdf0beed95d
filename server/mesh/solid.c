#include "mesh/solid.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

struct half_edge {
    uint32_t from, to, slot; // slot: 3 * triangle + corner
};

static int by_ends(const void *left, const void *right) {
    const struct half_edge *a = left, *b = right;
    if (a->from != b->from)
        return a->from < b->from ? -1 : 1;
    return (a->to > b->to) - (a->to < b->to);
}

static void find_neighbours(struct solid *solid) {
    const struct mesh *mesh = solid->mesh;
    size_t count = 3 * (size_t)mesh->triangle_count;
    struct half_edge *edges = alloc(count, sizeof *edges);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t next = i % 3 == 2 ? i - 2 : i + 1;
        edges[i] = (struct half_edge){mesh->triangles[i], mesh->triangles[next], i};
    }
    qsort(edges, count, sizeof *edges, by_ends);
    for (size_t i = 0; i < count; i++) {
        struct half_edge twin = {edges[i].to, edges[i].from, 0};
        const struct half_edge *found = bsearch(&twin, edges, count, sizeof twin, by_ends);
        solid->neighbours[edges[i].slot] = found ? found->slot / 3 : MESH_NONE;
    }
    free(edges);
}

static double angle_at(vec3 p, vec3 a, vec3 b) {
    vec3 u = vec3_sub(a, p), v = vec3_sub(b, p);
    return atan2(vec3_length(vec3_cross(u, v)), vec3_dot(u, v));
}

static void find_normals(struct solid *solid) {
    const struct mesh *mesh = solid->mesh;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 p[3] = {mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1), mesh_corner(mesh, t, 2)};
        vec3 cross = vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0]));
        solid->face_normals[t] = vec3_unit_or(cross, (vec3){0});
        for (uint32_t i = 0; i < 3; i++) {
            vec3 *normal = &solid->vertex_normals[mesh->triangles[3 * (size_t)t + i]];
            double angle = angle_at(p[i], p[(i + 1) % 3], p[(i + 2) % 3]);
            *normal = vec3_add_scaled(*normal, angle, solid->face_normals[t]);
        }
    }
}

enum result solid_init(struct solid *solid, const struct mesh *mesh, struct error *err) {
    *solid = (struct solid){.mesh = mesh, .box = mesh_bounds(mesh)};
    solid->face_normals = alloc(mesh->triangle_count, sizeof(vec3));
    solid->vertex_normals = alloc(mesh->vertex_count, sizeof(vec3));
    solid->neighbours = alloc(3 * (size_t)mesh->triangle_count, sizeof(uint32_t));
    find_neighbours(solid);
    find_normals(solid);
    return query_create(mesh, &solid->query, err);
}

void solid_fini(struct solid *solid) {
    query_destroy(&solid->query);
    free(solid->face_normals);
    free(solid->vertex_normals);
    free(solid->neighbours);
    memset(solid, 0, sizeof *solid);
}

static vec3 pseudo_normal(const struct solid *solid, const struct closest *closest) {
    size_t slot = 3 * (size_t)closest->triangle + (size_t)closest->corner;
    if (closest->feature == FEATURE_VERTEX)
        return solid->vertex_normals[solid->mesh->triangles[slot]];
    vec3 normal = solid->face_normals[closest->triangle];
    if (closest->feature == FEATURE_EDGE && solid->neighbours[slot] != MESH_NONE)
        normal = vec3_add(normal, solid->face_normals[solid->neighbours[slot]]);
    return normal;
}

// A scan's fold can turn a pseudo-normal round, and with it the side of points far away.
static bool box_holds(const struct box *box, vec3 p) {
    return p.x >= box->min.x && p.x <= box->max.x && p.y >= box->min.y && p.y <= box->max.y &&
           p.z >= box->min.z && p.z <= box->max.z;
}

double solid_signed(const struct solid *solid, vec3 p, const struct closest *closest) {
    double side = vec3_dot(vec3_sub(p, closest->point), pseudo_normal(solid, closest));
    return side < 0 && box_holds(&solid->box, p) ? -closest->distance : closest->distance;
}

double solid_distance(const struct solid *solid, vec3 p, uint32_t *hint) {
    struct closest closest;
    bool found = query_closest(solid->query, p, INFINITY, *hint, &closest);
    CHECK(found);
    *hint = closest.triangle;
    return solid_signed(solid, p, &closest);
}

double solid_depth(const struct solid *solid, vec3 from, vec3 to) {
    double length = vec3_distance(from, to), at = 0, deepest = 0;
    uint32_t hint = MESH_NONE;
    for (;;) {
        double t = length > 0 ? at / length : 0;
        double distance = solid_distance(solid, vec3_lerp(from, to, t), &hint);
        deepest = fmax(deepest, -distance);
        if (at >= length)
            return deepest;
        at = fmin(at + fmax(distance, 0.5), length); // nothing is nearer than the distance
    }
}
