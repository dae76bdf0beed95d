#include "match/mismatch.h"

#include "base/check.h"
#include "match/soup.h"
#include "mesh/columns.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TOUCHED, TISSUE, MESHES };

// ---- where both differ --------------------------------------------------------------------------

static bool is_same(const struct mismatch_setting *s, uint32_t triangle, uint32_t touched) {
    const uint32_t *of = s->tissue->triangles + 3 * (size_t)triangle;
    const uint32_t *as = s->touched->triangles + 3 * (size_t)touched;
    for (int i = 0; i < 3; i++) {
        const float *a = s->tissue->positions + 3 * (size_t)of[i];
        const float *b = s->touched->positions + 3 * (size_t)as[i];
        if (a[0] != b[0] || a[1] != b[1] || a[2] != b[2])
            return false;
    }
    return true;
}

static void extend(struct box *box, const struct mesh *mesh, uint32_t triangle) {
    for (int i = 0; i < 3; i++) {
        vec3 p = mesh_corner(mesh, triangle, i);
        *box = box_around(*box, (struct box){p, p});
    }
}

// Around all triangles that one of both has alone: beside them no column tells of a difference.
// Empty (min above max) where there is none.
static struct box box_of_difference(const struct mismatch_setting *s) {
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    bool *kept = alloc(s->touched->triangle_count, sizeof *kept);
    for (uint32_t t = 0; t < s->tissue->triangle_count; t++) {
        uint32_t id = s->triangle_ids ? s->triangle_ids[t] : MESH_NONE;
        if (id < s->touched->triangle_count && is_same(s, t, id))
            kept[id] = true;
        else
            extend(&box, s->tissue, t);
    }
    for (uint32_t t = 0; t < s->touched->triangle_count; t++)
        if (!kept[t])
            extend(&box, s->touched, t);
    free(kept);
    return box;
}

// ---- columns ------------------------------------------------------------------------------------

static void columns_over(const struct mesh *mesh, struct box lattice, struct box part,
                         double step_mm, struct columns *out) {
    vec3 *points = alloc_resize(NULL, mesh->vertex_count, sizeof *points);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        points[v] = mesh_vertex(mesh, v);
    columns_init_over(out, mesh, points, step_mm, lattice, part);
    free(points);
}

// ---- a column -----------------------------------------------------------------------------------

struct span {
    double low, high;
};

// Of a convex part over x, y; empty where low >= high.
static struct span span_of(const struct convex *part, double x, double y) {
    struct span span = {-INFINITY, INFINITY};
    for (int i = 0; i < part->plane_count; i++) {
        vec3 n = part->planes[i].normal;
        double rest = part->planes[i].offset - n.x * x - n.y * y;
        if (n.z > 0)
            span.high = fmin(span.high, rest / n.z);
        else if (n.z < 0)
            span.low = fmax(span.low, rest / n.z);
        else if (rest < 0)
            return (struct span){0, 0};
    }
    return span;
}

#define EDGE_MM 1e-6 // beside a part's box nothing of it is over x, y, whatever rounding does

static bool may_be_over(const struct convex *part, double x, double y) {
    return x >= part->box.min.x - EDGE_MM && x <= part->box.max.x + EDGE_MM &&
           y >= part->box.min.y - EDGE_MM && y <= part->box.max.y + EDGE_MM;
}

// Sorted, those that overlap joined; how many.
static int clefts_over(const struct mismatch_setting *s, double x, double y, struct span *out) {
    int count = 0, joined = 0;
    for (int i = 0; i < s->cleft_count; i++) {
        if (!may_be_over(&s->clefts[i], x, y))
            continue;
        struct span span = span_of(&s->clefts[i], x, y);
        int at = count;
        if (!(span.low < span.high))
            continue;
        for (count++; at > 0 && out[at - 1].low > span.low; at--)
            out[at] = out[at - 1];
        out[at] = span;
    }
    for (int i = 0; i < count; i++) {
        if (joined && out[i].low <= out[joined - 1].high)
            out[joined - 1].high = fmax(out[joined - 1].high, out[i].high);
        else
            out[joined++] = out[i];
    }
    return joined;
}

// What is left of low to high outside the clefts.
static double outside(double low, double high, const struct span *clefts, int count) {
    double length = high - low;
    for (int i = 0; i < count; i++)
        length -= fmax(0, fmin(high, clefts[i].high) - fmax(low, clefts[i].low));
    return length;
}

static void add_column(const struct columns columns[MESHES], size_t index,
                       const struct span *clefts, int cleft_count, struct mismatch *sum) {
    const struct columns *a = &columns[TOUCHED], *b = &columns[TISSUE];
    size_t i = a->first[index], k = b->first[index];
    bool in_a = false, in_b = false;
    double from = 0;
    while (i < a->first[index + 1] || k < b->first[index + 1]) {
        bool take_a =
            k == b->first[index + 1] || (i < a->first[index + 1] && a->heights[i] <= b->heights[k]);
        double to = take_a ? a->heights[i] : b->heights[k];
        if (in_a != in_b)
            *(in_a ? &sum->touched_mm3 : &sum->seen_mm3) += outside(from, to, clefts, cleft_count);
        from = to;
        in_a ^= take_a;
        in_b ^= !take_a;
        i += take_a;
        k += !take_a;
    }
}

static bool is_empty(const struct columns *columns, size_t index) {
    return columns->first[index] == columns->first[index + 1];
}

void mismatch_measure(const struct mismatch_setting *s, struct mismatch *out) {
    struct columns columns[MESHES];
    struct box box = box_around(mesh_bounds(s->touched), mesh_bounds(s->tissue));
    struct box where = box_of_difference(s);
    struct span *clefts = alloc((size_t)s->cleft_count, sizeof *clefts);
    columns_over(s->touched, box, where, s->step_mm, &columns[TOUCHED]);
    columns_over(s->tissue, box, where, s->step_mm, &columns[TISSUE]);
    *out = (struct mismatch){0};
    size_t nx = (size_t)columns->nx, count = nx * (size_t)columns->ny;
    for (size_t c = 0; c < count; c++) {
        if (is_empty(&columns[TOUCHED], c) && is_empty(&columns[TISSUE], c))
            continue;
        double x = columns->x + s->step_mm * (columns->i0 + (double)(c % nx));
        double y = columns->y + s->step_mm * (columns->j0 + (double)(c / nx));
        add_column(columns, c, clefts, clefts_over(s, x, y, clefts), out);
    }
    out->touched_mm3 *= s->step_mm * s->step_mm;
    out->seen_mm3 *= s->step_mm * s->step_mm;
    for (int i = 0; i < MESHES; i++)
        columns_fini(&columns[i]);
    free(clefts);
}

// ---- at vertices --------------------------------------------------------------------------------

#define WALL_MM 1e-3     // a cleft's wall lies so far from it at most
#define WEIGHT_MIN 1e-12 // less is none
#define SAME_MM 1e-5     // of a vertex where nothing has moved

// S'', and the triangles around each of its vertices: of vertex v those from fans[first[v]] on.
struct around {
    const struct mesh *mesh;
    struct soup soup;
    uint32_t *first, *fans;
};

static vec3 normal_of(const struct mesh *mesh, uint32_t triangle) {
    vec3 corners[3];
    for (int i = 0; i < 3; i++)
        corners[i] = mesh_corner(mesh, triangle, i);
    return vec3_unit_or(soup_area2(corners), (vec3){0});
}

static void around_init(struct around *a, const struct mesh *mesh) {
    *a = (struct around){.mesh = mesh};
    a->first = alloc((size_t)mesh->vertex_count + 2, sizeof *a->first);
    a->fans = alloc(3 * (size_t)mesh->triangle_count, sizeof *a->fans);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        a->first[mesh->triangles[i] + 2]++;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        a->first[v + 2] += a->first[v + 1];
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 corners[3];
        for (int i = 0; i < 3; i++) {
            corners[i] = mesh_corner(mesh, t, i);
            a->fans[a->first[mesh->triangles[3 * (size_t)t + (size_t)i] + 1]++] = t;
        }
        soup_add(&a->soup, corners, t, false);
    }
    soup_build(&a->soup);
}

static void around_fini(struct around *a) {
    soup_fini(&a->soup);
    free(a->first);
    free(a->fans);
}

static double angle_in(const struct mesh *mesh, uint32_t triangle, int corner) {
    vec3 p = mesh_corner(mesh, triangle, corner);
    vec3 u = vec3_sub(mesh_corner(mesh, triangle, (corner + 1) % 3), p);
    vec3 v = vec3_sub(mesh_corner(mesh, triangle, (corner + 2) % 3), p);
    return atan2(vec3_length(vec3_cross(u, v)), vec3_dot(u, v));
}

static int corner_at(const struct mesh *mesh, uint32_t triangle, uint32_t vertex) {
    for (int i = 0; i < 3; i++)
        if (mesh->triangles[3 * (size_t)triangle + (size_t)i] == vertex)
            return i;
    return -1;
}

// Of the edge from one vertex to another; where both are the same, of that vertex, weighted by
// angle (Bærentzen and Aanæs 2005).
static vec3 normal_around(const struct around *a, uint32_t from, uint32_t to) {
    vec3 sum = {0};
    for (uint32_t i = a->first[from]; i < a->first[from + 1]; i++) {
        uint32_t t = a->fans[i];
        int corner = corner_at(a->mesh, t, to);
        if (corner >= 0)
            sum = vec3_add_scaled(sum, from == to ? angle_in(a->mesh, t, corner) : 1,
                                  normal_of(a->mesh, t));
    }
    return sum;
}

static vec3 pseudo_normal(const struct around *a, const struct soup_closest *at) {
    const struct soup_triangle *triangle = &a->soup.at[at->index];
    const uint32_t *corners = a->mesh->triangles + 3 * (size_t)triangle->id;
    uint32_t ends[3];
    int count = 0;
    for (int i = 0; i < 3; i++)
        if (at->weights[i] > WEIGHT_MIN)
            ends[count++] = corners[i];
    return count == 3 ? triangle->normal : normal_around(a, ends[0], ends[count - 1]);
}

static double signed_mm(struct around *a, vec3 p, uint32_t *hint) {
    struct soup_search search = {.point = p, .least = -1, .within = INFINITY, .hint = *hint};
    struct soup_closest at;
    if (!soup_closest(&a->soup, &search, &at))
        return 0;
    *hint = at.index;
    double mm = fmin(at.distance, MISMATCH_REACH_MM);
    return vec3_dot(vec3_sub(p, at.point), pseudo_normal(a, &at)) < 0 ? mm : -mm;
}

static bool is_in_cleft(const struct mismatch_setting *s, vec3 p) {
    for (int i = 0; i < s->cleft_count; i++) {
        const struct convex *cleft = &s->clefts[i];
        double outside = -INFINITY;
        for (int k = 0; k < cleft->plane_count; k++)
            outside = fmax(outside, vec3_dot(cleft->planes[k].normal, p) - cleft->planes[k].offset);
        if (outside <= WALL_MM)
            return true;
    }
    return false;
}

static bool has_stayed(const struct mismatch_setting *s, uint32_t vertex, uint32_t id) {
    return id < s->touched->vertex_count &&
           vec3_distance(mesh_vertex(s->touched, id), mesh_vertex(s->tissue, vertex)) <= SAME_MM;
}

void mismatch_at_vertices(const struct mismatch_setting *s, const uint32_t *ids, double *out_mm) {
    struct around around = {0};
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < s->tissue->vertex_count; v++) {
        vec3 p = mesh_vertex(s->tissue, v);
        out_mm[v] = 0;
        if (has_stayed(s, v, ids[v]) || is_in_cleft(s, p))
            continue;
        if (!around.mesh)
            around_init(&around, s->touched);
        out_mm[v] = signed_mm(&around, p, &hint);
    }
    around_fini(&around);
}
