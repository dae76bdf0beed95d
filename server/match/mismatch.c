#include "match/mismatch.h"

#include "base/check.h"
#include "mesh/columns.h"

#include <math.h>
#include <stdlib.h>

enum { TOUCHED, TISSUE, MESHES };

// Both on one lattice: two more points, which no triangle uses, give them the same box.
static void columns_of(const struct mesh *mesh, struct box box, double step_mm,
                       struct columns *out) {
    struct mesh placed = *mesh;
    vec3 *points = alloc((size_t)mesh->vertex_count + 2, sizeof *points);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        points[v] = mesh_vertex(mesh, v);
    points[placed.vertex_count++] = box.min;
    points[placed.vertex_count++] = box.max;
    columns_init(out, &placed, points, step_mm);
    free(points);
}

static struct box box_around(struct box a, struct box b) {
    return (struct box){{fmin(a.min.x, b.min.x), fmin(a.min.y, b.min.y), fmin(a.min.z, b.min.z)},
                        {fmax(a.max.x, b.max.x), fmax(a.max.y, b.max.y), fmax(a.max.z, b.max.z)}};
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

// Sorted, those that overlap joined; how many.
static int clefts_over(const struct mismatch_setting *s, double x, double y, struct span *out) {
    int count = 0, joined = 0;
    for (int i = 0; i < s->cleft_count; i++) {
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

void mismatch_measure(const struct mismatch_setting *s, struct mismatch *out) {
    struct columns columns[MESHES];
    struct box box = box_around(mesh_bounds(s->touched), mesh_bounds(s->tissue));
    struct span *clefts = alloc((size_t)s->cleft_count, sizeof *clefts);
    columns_of(s->touched, box, s->step_mm, &columns[TOUCHED]);
    columns_of(s->tissue, box, s->step_mm, &columns[TISSUE]);
    *out = (struct mismatch){0};
    size_t nx = (size_t)columns->nx, count = nx * (size_t)columns->ny;
    for (size_t c = 0; c < count; c++) {
        double x = columns->x + s->step_mm * (double)(c % nx);
        double y = columns->y + s->step_mm * (double)(c / nx);
        add_column(columns, c, clefts, clefts_over(s, x, y, clefts), out);
    }
    out->touched_mm3 *= s->step_mm * s->step_mm;
    out->seen_mm3 *= s->step_mm * s->step_mm;
    for (int i = 0; i < MESHES; i++)
        columns_fini(&columns[i]);
    free(clefts);
}
