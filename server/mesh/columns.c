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

static int by_column_and_height(const void *left, const void *right) {
    const struct column_crossing *a = left, *b = right;
    if (a->column != b->column)
        return a->column < b->column ? -1 : 1;
    return (a->height > b->height) - (a->height < b->height);
}

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

static void cross_triangle(const struct columns *columns, const vec3 *points, const uint32_t *t,
                           struct crossings *crossings) {
    vec3 a = points[t[0]], b = points[t[1]], c = points[t[2]];
    double step = columns->step, z;
    int i0 = (int)ceil((fmin(a.x, fmin(b.x, c.x)) - columns->x) / step);
    int i1 = (int)floor((fmax(a.x, fmax(b.x, c.x)) - columns->x) / step);
    int j0 = (int)ceil((fmin(a.y, fmin(b.y, c.y)) - columns->y) / step);
    int j1 = (int)floor((fmax(a.y, fmax(b.y, c.y)) - columns->y) / step);
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++)
            if (height_over(points, t, columns->x + i * step, columns->y + j * step, &z))
                add_crossing(crossings, (size_t)j * (size_t)columns->nx + (size_t)i, z);
}

static void place_lattice(struct columns *columns, const struct mesh *mesh, const vec3 *points,
                          double step) {
    vec3 low = points[0], high = points[0];
    for (uint32_t v = 1; v < mesh->vertex_count; v++) {
        low = (vec3){fmin(low.x, points[v].x), fmin(low.y, points[v].y), 0};
        high = (vec3){fmax(high.x, points[v].x), fmax(high.y, points[v].y), 0};
    }
    int nx = (int)ceil((high.x - low.x) / step) + 1, ny = (int)ceil((high.y - low.y) / step) + 1;
    *columns = (struct columns){.x = (low.x + high.x - (nx - 1) * step) / 2,
                                .y = (low.y + high.y - (ny - 1) * step) / 2,
                                .step = step,
                                .nx = nx,
                                .ny = ny};
}

void columns_init(struct columns *columns, const struct mesh *mesh, const vec3 *points,
                  double step) {
    struct crossings crossings = {0};
    place_lattice(columns, mesh, points, step);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        cross_triangle(columns, points, mesh->triangles + 3 * (size_t)t, &crossings);
    if (crossings.count > 0) // a mesh smaller than the step may have none
        qsort(crossings.all, crossings.count, sizeof *crossings.all, by_column_and_height);
    size_t count = (size_t)columns->nx * (size_t)columns->ny;
    columns->first = alloc(count + 1, sizeof *columns->first);
    columns->heights = alloc(crossings.count, sizeof *columns->heights);
    for (size_t i = 0; i < crossings.count; i++) {
        columns->heights[i] = crossings.all[i].height;
        columns->first[crossings.all[i].column + 1]++;
    }
    for (size_t c = 0; c < count; c++)
        columns->first[c + 1] += columns->first[c];
    free(crossings.all);
}

void columns_fini(struct columns *columns) {
    free(columns->first);
    free(columns->heights);
    *columns = (struct columns){0};
}
