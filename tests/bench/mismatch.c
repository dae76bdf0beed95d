#include "mismatch.h"

#include "base/check.h"
#include "mesh/columns.h"
#include "mesh/query.h"

#include <stdlib.h>
#include <string.h>

// ---- volumes, along columns ---------------------------------------------------------------------

#define BESIDE_MM 3.0 // around S': no surface sticks out farther
#define MARKS_MAX 512 // of all bodies on one column

// All meshes on one lattice: two more points, which no triangle uses, give them the same box.
static void columns_of(const struct mesh *mesh, struct box box, struct columns *out) {
    struct mesh placed = *mesh;
    vec3 *points = alloc((size_t)mesh->vertex_count + 2, sizeof *points);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        points[v] = mesh_vertex(mesh, v);
    points[placed.vertex_count++] = box.min;
    points[placed.vertex_count++] = box.max;
    columns_init(out, &placed, points, COLUMN_MM);
    free(points);
}

enum body_of_column { WHOLE, TOUCHED, CUT, CLEFT, BODIES };

struct mark {
    double z;
    int body;
    int in; // 1: from here up inside, -1: outside again
};

struct column {
    struct mark marks[MARKS_MAX];
    int count;
};

static void add_mark(struct column *column, double z, int body, int in) {
    CHECK(column->count < MARKS_MAX);
    column->marks[column->count++] = (struct mark){z, body, in};
}

static void add_mesh(struct column *column, const struct columns *columns, size_t index, int body) {
    for (size_t k = columns->first[index]; k < columns->first[index + 1]; k++)
        add_mark(column, columns->heights[k], body, (k - columns->first[index]) % 2 ? -1 : 1);
}

static void add_part(struct column *column, const struct convex *part, double x, double y) {
    double low = -INFINITY, high = INFINITY;
    for (int i = 0; i < part->plane_count; i++) {
        vec3 n = part->planes[i].normal;
        double rest = part->planes[i].offset - n.x * x - n.y * y;
        if (n.z > 0)
            high = fmin(high, rest / n.z);
        else if (n.z < 0)
            low = fmax(low, rest / n.z);
        else if (rest < 0)
            return;
    }
    if (low < high) {
        add_mark(column, low, CLEFT, 1);
        add_mark(column, high, CLEFT, -1);
    }
}

static int compare(const void *a, const void *b) {
    const struct mark *x = a, *y = b;
    return (x->z > y->z) - (x->z < y->z);
}

static void add_up(struct column *column, double area, struct mismatch *out) {
    int in[BODIES] = {0};
    qsort(column->marks, (size_t)column->count, sizeof *column->marks, compare);
    for (int i = 0; i + 1 < column->count; i++) {
        in[column->marks[i].body] += column->marks[i].in;
        double volume = area * (column->marks[i + 1].z - column->marks[i].z);
        if (in[CLEFT] > 0)
            continue;
        out->touched_mm3 += in[TOUCHED] && !in[CUT] ? volume : 0;
        out->seen_mm3 += in[CUT] && !in[TOUCHED] ? volume : 0;
        out->cut_mm3 += in[WHOLE] && !in[CUT] ? volume : 0;
    }
}

void mismatch_measure(const struct mesh *whole, const struct mesh *touched, const struct mesh *cut,
                      const struct case_region *tear, struct mismatch *out) {
    const struct mesh *meshes[CLEFT] = {[WHOLE] = whole, [TOUCHED] = touched, [CUT] = cut};
    struct columns columns[CLEFT];
    struct box box = mesh_bounds(whole);
    box.min = vec3_sub(box.min, (vec3){BESIDE_MM, BESIDE_MM, BESIDE_MM});
    box.max = vec3_add(box.max, (vec3){BESIDE_MM, BESIDE_MM, BESIDE_MM});
    for (int i = 0; i < CLEFT; i++)
        columns_of(meshes[i], box, &columns[i]);
    *out = (struct mismatch){0};
    size_t count = (size_t)columns[0].nx * (size_t)columns[0].ny;
    for (size_t c = 0; c < count; c++) {
        struct column column = {.count = 0};
        double x = columns[0].x + COLUMN_MM * (double)(c % (size_t)columns[0].nx);
        double y = columns[0].y + COLUMN_MM * (double)(c / (size_t)columns[0].nx);
        for (int i = 0; i < CLEFT; i++)
            add_mesh(&column, &columns[i], c, i);
        for (int i = 0; tear && i < tear->part_count; i++)
            add_part(&column, &tear->parts[i], x, y);
        add_up(&column, COLUMN_MM * COLUMN_MM, out);
    }
    for (int i = 0; i < CLEFT; i++)
        columns_fini(&columns[i]);
}

// ---- distances, over the surface ----------------------------------------------------------------

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

enum result mismatch_distances(const struct mesh *from, const bool *fresh, const struct mesh *to,
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
