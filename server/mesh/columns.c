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

static void cross_triangle(const struct columns *columns, const vec3 *points, const uint32_t *t,
                           struct crossings *crossings) {
    vec3 a = points[t[0]], b = points[t[1]], c = points[t[2]];
    double step = columns->step, z;
    int i0 = round_up((lower(lower(a.x, b.x), c.x) - columns->x) / step);
    int i1 = round_down((higher(higher(a.x, b.x), c.x) - columns->x) / step);
    int j0 = round_up((lower(lower(a.y, b.y), c.y) - columns->y) / step);
    int j1 = round_down((higher(higher(a.y, b.y), c.y) - columns->y) / step);
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++)
            if (height_over(points, t, columns->x + i * step, columns->y + j * step, &z))
                add_crossing(crossings, (size_t)j * (size_t)columns->nx + (size_t)i, z);
}

static void place_lattice(struct columns *columns, const struct mesh *mesh, const vec3 *points,
                          double step) {
    vec3 low = points[0], high = points[0];
    for (uint32_t v = 1; v < mesh->vertex_count; v++) {
        low = (vec3){lower(low.x, points[v].x), lower(low.y, points[v].y), 0};
        high = (vec3){higher(high.x, points[v].x), higher(high.y, points[v].y), 0};
    }
    int nx = (int)ceil((high.x - low.x) / step) + 1, ny = (int)ceil((high.y - low.y) / step) + 1;
    *columns = (struct columns){.x = (low.x + high.x - (nx - 1) * step) / 2,
                                .y = (low.y + high.y - (ny - 1) * step) / 2,
                                .step = step,
                                .nx = nx,
                                .ny = ny};
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

void columns_init(struct columns *columns, const struct mesh *mesh, const vec3 *points,
                  double step) {
    struct crossings crossings = {0};
    place_lattice(columns, mesh, points, step);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        cross_triangle(columns, points, mesh->triangles + 3 * (size_t)t, &crossings);
    sort_into_columns(&crossings, columns);
    free(crossings.all);
}

void columns_fini(struct columns *columns) {
    free(columns->first);
    free(columns->heights);
    *columns = (struct columns){0};
}
