#include "check/facing.h"

#include "base/check.h"
#include "check/parallel.h"

#include <stdlib.h>

#define FACING_COSINE (-0.5)
#define TOUCH_MM 1e-6

struct compare {
    const struct warp_scene *scene;
    struct facing_pair *pairs; // of surface a's vertices with b: [a * surface_count + b]
    uint32_t skipped;
};

static vec3 face_normal(const struct mesh *mesh, uint32_t triangle) {
    vec3 a = mesh_corner(mesh, triangle, 0);
    return vec3_cross(vec3_sub(mesh_corner(mesh, triangle, 1), a),
                      vec3_sub(mesh_corner(mesh, triangle, 2), a));
}

// A triangle at each vertex, for its displacement, and the normal.
struct vertex {
    uint32_t triangle;
    int corner;
    vec3 normal;
};

static struct vertex *vertices_of(const struct mesh *mesh) {
    struct vertex *vertices = alloc(mesh->vertex_count, sizeof *vertices);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        vertices[v].triangle = MESH_NONE;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int i = 0; i < 3; i++) {
            struct vertex *v = &vertices[mesh->triangles[3 * (size_t)t + (size_t)i]];
            v->triangle = t;
            v->corner = i;
            v->normal = vec3_add(v->normal, face_normal(mesh, t));
        }
    return vertices;
}

static vec3 delta_of(const struct warp_scene *scene, int surface, const struct vertex *v) {
    struct closest at = {.triangle = v->triangle,
                         .weights = {v->corner == 0, v->corner == 1, v->corner == 2}};
    at.point = mesh_corner(scene->surfaces[surface].mesh, v->triangle, v->corner);
    return warp_of_contact(scene, surface, &at);
}

// The way from x to the closest point of b that faces it, of unit length; false where it does not.
static bool faces(const struct warp_scene *scene, int b, vec3 x, vec3 normal,
                  struct closest *out_closest, vec3 *out_way, double *out_gap) {
    const struct warp_surface *s = &scene->surfaces[b];
    pose T = scene->T_world_body[s->body];
    vec3 p = pose_apply_inverse(T, x);
    if (!query_closest(s->query, p, FACING_GAP_MM, MESH_NONE, out_closest))
        return false;
    vec3 zero = {0};
    vec3 facing = vec3_unit_or(face_normal(s->mesh, out_closest->triangle), zero);
    facing = quat_rotate(T.rotation, facing);
    if (vec3_dot(facing, normal) > FACING_COSINE)
        return false;
    vec3 across = quat_rotate(T.rotation, vec3_sub(out_closest->point, p));
    bool overlaps = vec3_dot(across, facing) > 0;
    *out_gap = overlaps ? 0 : out_closest->distance;
    *out_way = overlaps || *out_gap < TOUCH_MM ? normal : vec3_unit_or(across, normal);
    return true;
}

static void keep(struct facing_spot *spot, bool had, double had_value, double value,
                 const struct facing_spot *other) {
    if (!had || value > had_value)
        *spot = *other;
}

static void take_spot(struct facing_pair *pair, const struct facing_spot *spot) {
    pair->count++;
    if (facing_is_filled(spot)) {
        keep(&pair->filling, pair->filled++, pair->filling.closed_mm - pair->filling.gap_mm,
             spot->closed_mm - spot->gap_mm, spot);
    }
    if (facing_is_strained(spot)) {
        keep(&pair->strain, pair->strained++, pair->strain.apart_mm - pair->strain.gap_mm,
             spot->apart_mm - spot->gap_mm, spot);
    }
}

// A point of a surface, in the world.
struct point {
    vec3 place, normal, delta;
};

static bool compare_point(const struct warp_scene *scene, const struct point *point, int b,
                          struct facing_spot *out) {
    struct closest closest;
    vec3 way;
    *out = (struct facing_spot){.place = point->place};
    if (!faces(scene, b, point->place, point->normal, &closest, &way, &out->gap_mm))
        return false;
    vec3 off = vec3_sub(warp_of_contact(scene, b, &closest), point->delta);
    out->closed_mm = -vec3_dot(way, off);
    out->apart_mm = vec3_length(off);
    return true;
}

static void compare_vertex(const struct compare *c, int a, const struct vertex *v) {
    const struct warp_scene *scene = c->scene;
    const struct warp_surface *s = &scene->surfaces[a];
    pose T = scene->T_world_body[s->body];
    vec3 zero = {0};
    struct point point = {pose_apply(T, mesh_corner(s->mesh, v->triangle, v->corner)),
                          quat_rotate(T.rotation, vec3_unit_or(v->normal, zero)),
                          delta_of(scene, a, v)};
    for (int b = 0; b < scene->surface_count; b++) {
        struct facing_spot spot;
        if (b != a && !(c->skipped >> b & 1) && compare_point(scene, &point, b, &spot))
            take_spot(&c->pairs[a * scene->surface_count + b], &spot);
    }
}

static void compare_surface(void *context, int a) {
    const struct compare *c = context;
    if (c->skipped >> a & 1)
        return;
    const struct mesh *mesh = c->scene->surfaces[a].mesh;
    struct vertex *vertices = vertices_of(mesh);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        if (vertices[v].triangle != MESH_NONE)
            compare_vertex(c, a, &vertices[v]);
    free(vertices);
}

static void add_pair(struct facing_pair *pair, const struct facing_pair *other) {
    if (other->filled)
        keep(&pair->filling, pair->filled, pair->filling.closed_mm - pair->filling.gap_mm,
             other->filling.closed_mm - other->filling.gap_mm, &other->filling);
    if (other->strained)
        keep(&pair->strain, pair->strained, pair->strain.apart_mm - pair->strain.gap_mm,
             other->strain.apart_mm - other->strain.gap_mm, &other->strain);
    pair->count += other->count;
    pair->filled += other->filled;
    pair->strained += other->strained;
}

void facing_compare(const struct warp_scene *scene, uint32_t skipped, struct facing_figures *out) {
    int n = scene->surface_count;
    struct compare c = {scene, alloc((size_t)(n * n) + 1, sizeof *c.pairs), skipped};
    parallel_for(n, compare_surface, &c, NULL);
    out->count = 0;
    for (int a = 0; a < n; a++)
        for (int b = a + 1; b < n; b++) {
            struct facing_pair *pair = &out->pairs[out->count];
            *pair = c.pairs[a * n + b];
            pair->a = a;
            pair->b = b;
            add_pair(pair, &c.pairs[b * n + a]);
            out->count += pair->count > 0;
        }
    free(c.pairs);
}

bool facing_at(const struct warp_scene *scene, uint32_t skipped, int surface, uint32_t triangle,
               const double weights[3], struct facing_spot *out_filling,
               struct facing_spot *out_strain) {
    const struct warp_surface *s = &scene->surfaces[surface];
    pose T = scene->T_world_body[s->body];
    struct closest at = {.triangle = triangle};
    for (int i = 0; i < 3; i++) {
        at.weights[i] = weights[i];
        at.point = vec3_add_scaled(at.point, weights[i], mesh_corner(s->mesh, triangle, i));
    }
    struct point point = {pose_apply(T, at.point), {0}, warp_of_contact(scene, surface, &at)};
    vec3 zero = {0};
    point.normal = quat_rotate(T.rotation, vec3_unit_or(face_normal(s->mesh, triangle), zero));
    bool faced = false;
    for (int b = 0; b < scene->surface_count; b++) {
        struct facing_spot spot;
        if (b == surface || skipped >> b & 1 || !compare_point(scene, &point, b, &spot))
            continue;
        if (!faced || spot.closed_mm - spot.gap_mm > out_filling->closed_mm - out_filling->gap_mm)
            *out_filling = spot;
        if (!faced || spot.apart_mm - spot.gap_mm > out_strain->apart_mm - out_strain->gap_mm)
            *out_strain = spot;
        faced = true;
    }
    return faced;
}
