#include "mesh/columns.h"

#include "base/check.h"

#include <stdlib.h>

struct column_crossing {
    size_t column;
    double height;
};

struct crossings {
    struct column_crossing *all;
    size_t count, capacity;
};

static void add_crossing(struct crossings *crossings, size_t column, double height) {
    if (crossings->count == crossings->capacity) {
        crossings->capacity = 2 * crossings->capacity + 4096;
        crossings->all = alloc_resize(crossings->all, crossings->capacity, sizeof *crossings->all);
    }
    crossings->all[crossings->count++] = (struct column_crossing){column, height};
}

// Twice the area of (a, b, p) seen from above; the same number but for its sign from both
// triangles of an edge.
static double area_to(const vec3 *points, uint32_t a, uint32_t b, double x, double y) {
    vec3 p = points[a < b ? a : b], q = points[a < b ? b : a];
    double area = (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x);
    return a < b ? area : -area;
}

// On which side of the edge the line stands; on the edge itself, left of the way that rises in id.
static bool is_left(double area, uint32_t a, uint32_t b) {
    return area > 0 || (area == 0 && a < b);
}

static bool height_over(const vec3 *points, const uint32_t *t, double x, double y, double *out_z) {
    double a = area_to(points, t[1], t[2], x, y), b = area_to(points, t[2], t[0], x, y),
           c = area_to(points, t[0], t[1], x, y);
    bool left = is_left(a, t[1], t[2]);
    if (is_left(b, t[2], t[0]) != left || is_left(c, t[0], t[1]) != left || a + b + c == 0)
        return false;
    *out_z = (a * points[t[0]].z + b * points[t[1]].z + c * points[t[2]].z) / (a + b + c);
    return true;
}

// As ceil and floor, without a call.
static int round_up(double x) {
    int i = (int)x;
    return i + (x > i);
}

static int round_down(double x) {
    int i = (int)x;
    return i - (x < i);
}

// Those of the lattice's columns that are in the part.
static void cross_triangle(const struct columns *columns, const vec3 *points, const uint32_t *t,
                           struct crossings *crossings) {
    vec3 a = points[t[0]], b = points[t[1]], c = points[t[2]];
    double step = columns->step, z;
    int i0 = round_up((lower(lower(a.x, b.x), c.x) - columns->x) / step);
    int i1 = round_down((higher(higher(a.x, b.x), c.x) - columns->x) / step);
    int j0 = round_up((lower(lower(a.y, b.y), c.y) - columns->y) / step);
    int j1 = round_down((higher(higher(a.y, b.y), c.y) - columns->y) / step);
    i0 = i0 > columns->i0 ? i0 : columns->i0;
    j0 = j0 > columns->j0 ? j0 : columns->j0;
    i1 = i1 < columns->i0 + columns->nx ? i1 : columns->i0 + columns->nx - 1;
    j1 = j1 < columns->j0 + columns->ny ? j1 : columns->j0 + columns->ny - 1;
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++)
            if (height_over(points, t, columns->x + i * step, columns->y + j * step, &z))
                add_crossing(
                    crossings,
                    (size_t)(j - columns->j0) * (size_t)columns->nx + (size_t)(i - columns->i0), z);
}

static struct box bounds_of(const vec3 *points, uint32_t count) {
    struct box box = {points[0], points[0]};
    for (uint32_t v = 1; v < count; v++)
        box = box_around(box, (struct box){points[v], points[v]});
    return box;
}

static void place_lattice(struct columns *columns, struct box box, double step) {
    int nx = (int)ceil((box.max.x - box.min.x) / step) + 1;
    int ny = (int)ceil((box.max.y - box.min.y) / step) + 1;
    *columns = (struct columns){.x = (box.min.x + box.max.x - (nx - 1) * step) / 2,
                                .y = (box.min.y + box.max.y - (ny - 1) * step) / 2,
                                .step = step,
                                .nx = nx,
                                .ny = ny};
}

// Of the columns from 0 to *count - 1 those from low to high.
static void keep_part(double low, double high, int *out_first, int *in_out_count) {
    double first = higher(floor(low), 0), last = lower(ceil(high), *in_out_count - 1);
    bool any = first <= last;
    *out_first = any ? (int)first : 0;
    *in_out_count = any ? (int)last - (int)first + 1 : 0;
}

// Few have more than two.
static void sort_few(double *heights, size_t count) {
    for (size_t i = 1; i < count; i++) {
        double height = heights[i];
        size_t k = i;
        for (; k > 0 && heights[k - 1] > height; k--)
            heights[k] = heights[k - 1];
        heights[k] = height;
    }
}

static void sort_into_columns(const struct crossings *crossings, struct columns *columns) {
    size_t count = (size_t)columns->nx * (size_t)columns->ny;
    size_t *next = columns->first = alloc(count + 2, sizeof *columns->first);
    columns->heights = alloc(crossings->count, sizeof *columns->heights);
    for (size_t i = 0; i < crossings->count; i++)
        next[crossings->all[i].column + 2]++;
    for (size_t c = 0; c < count; c++)
        next[c + 2] += next[c + 1];
    for (size_t i = 0; i < crossings->count;
         i++) // next[c + 1] grows from a column's start to its end
        columns->heights[next[crossings->all[i].column + 1]++] = crossings->all[i].height;
    for (size_t c = 0; c < count; c++)
        sort_few(columns->heights + columns->first[c], columns->first[c + 1] - columns->first[c]);
}

// One bit for each side of the columns that a point is beside. A triangle whose corners are all
// beside one side is under none of them.
static uint8_t sides_beside(const struct columns *c, vec3 p) {
    double i = (p.x - c->x) / c->step, j = (p.y - c->y) / c->step;
    return (uint8_t)((i < c->i0) | (i > c->i0 + c->nx - 1) << 1 | (j < c->j0) << 2 |
                     (j > c->j0 + c->ny - 1) << 3);
}

static void find(struct columns *columns, const struct mesh *mesh, const vec3 *points) {
    struct crossings crossings = {0};
    uint8_t *beside = alloc(mesh->vertex_count, sizeof *beside);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        beside[v] = sides_beside(columns, points[v]);
    for (uint32_t i = 0; i < mesh->triangle_count; i++) {
        const uint32_t *t = mesh->triangles + 3 * (size_t)i;
        if (!(beside[t[0]] & beside[t[1]] & beside[t[2]]))
            cross_triangle(columns, points, t, &crossings);
    }
    free(beside);
    sort_into_columns(&crossings, columns);
    free(crossings.all);
}

void columns_init(struct columns *columns, const struct mesh *mesh, const vec3 *points,
                  double step) {
    place_lattice(columns, bounds_of(points, mesh->vertex_count), step);
    find(columns, mesh, points);
}

void columns_init_over(struct columns *columns, const struct mesh *mesh, const vec3 *points,
                       double step, struct box lattice, struct box part) {
    struct columns *c = columns;
    place_lattice(c, lattice, step);
    keep_part((part.min.x - c->x) / step, (part.max.x - c->x) / step, &c->i0, &c->nx);
    keep_part((part.min.y - c->y) / step, (part.max.y - c->y) / step, &c->j0, &c->ny);
    find(c, mesh, points);
}

void columns_fini(struct columns *columns) {
    free(columns->first);
    free(columns->heights);
    *columns = (struct columns){0};
}
