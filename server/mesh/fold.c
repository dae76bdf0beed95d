#include "mesh/fold.h"

#include "base/check.h"
#include "mesh/edges.h"

#include <stdlib.h>

struct boxed_triangle {
    struct box box;
    uint32_t triangle;
};

static int by_x(const void *left, const void *right) {
    const struct boxed_triangle *a = left, *b = right;
    if (a->box.min.x != b->box.min.x)
        return a->box.min.x < b->box.min.x ? -1 : 1;
    return (a->triangle > b->triangle) - (a->triangle < b->triangle);
}

static struct boxed_triangle *sorted_boxes(const struct mesh *mesh) {
    struct boxed_triangle *entries = alloc(mesh->triangle_count, sizeof *entries);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0), b = mesh_corner(mesh, t, 1), c = mesh_corner(mesh, t, 2);
        entries[t].triangle = t;
        entries[t].box.min =
            (vec3){fmin(a.x, fmin(b.x, c.x)), fmin(a.y, fmin(b.y, c.y)), fmin(a.z, fmin(b.z, c.z))};
        entries[t].box.max =
            (vec3){fmax(a.x, fmax(b.x, c.x)), fmax(a.y, fmax(b.y, c.y)), fmax(a.z, fmax(b.z, c.z))};
    }
    qsort(entries, mesh->triangle_count, sizeof *entries, by_x);
    return entries;
}

// Six times the volume of the tetrahedron.
static double volume_of(vec3 a, vec3 b, vec3 c, vec3 d) {
    return vec3_dot(vec3_sub(a, d), vec3_cross(vec3_sub(b, d), vec3_sub(c, d)));
}

static bool pierces(vec3 from, vec3 to, const vec3 t[3]) {
    double before = volume_of(t[0], t[1], t[2], from), after = volume_of(t[0], t[1], t[2], to);
    if (!(before * after < 0))
        return false;
    double a = volume_of(from, to, t[0], t[1]), b = volume_of(from, to, t[1], t[2]),
           c = volume_of(from, to, t[2], t[0]);
    return (a > 0 && b > 0 && c > 0) || (a < 0 && b < 0 && c < 0);
}

static bool has(const uint32_t *corners, uint32_t vertex) {
    return corners[0] == vertex || corners[1] == vertex || corners[2] == vertex;
}

// Whether an edge of triangle s that has no corner of t runs through it.
static bool runs_through(const struct mesh *mesh, uint32_t s, uint32_t t) {
    const uint32_t *from = mesh->triangles + 3 * (size_t)s, *into = mesh->triangles + 3 * (size_t)t;
    vec3 corners[3] = {mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1), mesh_corner(mesh, t, 2)};
    for (int i = 0; i < 3; i++) {
        uint32_t a = from[i], b = from[(i + 1) % 3];
        if (!has(into, a) && !has(into, b) &&
            pierces(mesh_vertex(mesh, a), mesh_vertex(mesh, b), corners))
            return true;
    }
    return false;
}

static bool boxes_apart(const struct box *a, const struct box *b) {
    return a->max.y < b->min.y || b->max.y < a->min.y || a->max.z < b->min.z || b->max.z < a->min.z;
}

static bool mark(bool folded, uint32_t s, uint32_t t, bool *out_folded) {
    if (folded && out_folded)
        out_folded[s] = out_folded[t] = true;
    return folded;
}

static uint32_t count_crossed(const struct mesh *mesh, bool *out_folded) {
    struct boxed_triangle *entries = sorted_boxes(mesh);
    uint32_t count = 0;
    for (uint32_t i = 0; i < mesh->triangle_count; i++)
        for (uint32_t k = i + 1;
             k < mesh->triangle_count && entries[k].box.min.x <= entries[i].box.max.x; k++) {
            uint32_t s = entries[i].triangle, t = entries[k].triangle;
            bool crossed = !boxes_apart(&entries[i].box, &entries[k].box) &&
                           (runs_through(mesh, s, t) || runs_through(mesh, t, s));
            count += mark(crossed, s, t, out_folded);
        }
    free(entries);
    return count;
}

static vec3 normal_of(const struct mesh *mesh, uint32_t t) {
    vec3 a = mesh_corner(mesh, t, 0);
    return vec3_unit_or(
        vec3_cross(vec3_sub(mesh_corner(mesh, t, 1), a), vec3_sub(mesh_corner(mesh, t, 2), a)),
        (vec3){0});
}

static uint32_t count_creased(const struct mesh *mesh, bool *out_folded) {
    const double turned = -0.99984769515639127; // the cosine of 179 degrees
    struct triangle_side *sides = edges_sorted(mesh);
    size_t count = 3 * (size_t)mesh->triangle_count;
    uint32_t creased = 0;
    for (size_t i = 0; i < count; i = edges_end(sides, i, count)) {
        if (edges_end(sides, i, count) != i + 2)
            continue;
        uint32_t s = sides[i].triangle, t = sides[i + 1].triangle;
        bool is_creased = vec3_dot(normal_of(mesh, s), normal_of(mesh, t)) < turned;
        creased += mark(is_creased, s, t, out_folded);
    }
    free(sides);
    return creased;
}

struct folds folds_of(const struct mesh *mesh, bool *out_folded) {
    for (uint32_t t = 0; out_folded && t < mesh->triangle_count; t++)
        out_folded[t] = false;
    uint32_t crossed = count_crossed(mesh, out_folded);
    return (struct folds){crossed, count_creased(mesh, out_folded)};
}
