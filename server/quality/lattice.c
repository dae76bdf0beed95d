#include "quality/lattice.h"

#include "base/check.h"

#include <limits.h>
#include <stdlib.h>

// ---- columns within bounds ----------------------------------------------------------------------

struct column_range {
    int x_low, x_high, y_low, y_high; // both ends are in it
};

static int clamp_int(double value, int low, int high) {
    return value > low ? value < high ? (int)value : high : low;
}

static struct column_range range_of(const struct lattice *lattice, const vec3 *points, int count) {
    double x_low = INFINITY, x_high = -INFINITY, y_low = INFINITY, y_high = -INFINITY;
    for (int i = 0; i < count; i++) {
        x_low = fmin(x_low, points[i].x);
        x_high = fmax(x_high, points[i].x);
        y_low = fmin(y_low, points[i].y);
        y_high = fmax(y_high, points[i].y);
    }
    const vec3 *o = &lattice->origin;
    return (struct column_range){
        clamp_int(ceil((x_low - o->x) / LATTICE_MM), 0, lattice->wide),
        clamp_int(floor((x_high - o->x) / LATTICE_MM), -1, lattice->wide - 1),
        clamp_int(ceil((y_low - o->y) / LATTICE_MM), 0, lattice->deep),
        clamp_int(floor((y_high - o->y) / LATTICE_MM), -1, lattice->deep - 1)};
}

static void range_join(struct column_range *range, const struct column_range *other) {
    if (other->x_low > other->x_high || other->y_low > other->y_high)
        return;
    range->x_low = other->x_low < range->x_low ? other->x_low : range->x_low;
    range->x_high = other->x_high > range->x_high ? other->x_high : range->x_high;
    range->y_low = other->y_low < range->y_low ? other->y_low : range->y_low;
    range->y_high = other->y_high > range->y_high ? other->y_high : range->y_high;
}

vec3 lattice_column_place(const struct lattice *lattice, int column) {
    return (vec3){lattice->origin.x + LATTICE_MM * (column % lattice->wide),
                  lattice->origin.y + LATTICE_MM * (column / lattice->wide), 0};
}

int lattice_column_at(const struct lattice *lattice, double x, double y) {
    double i = floor((x - lattice->origin.x) / LATTICE_MM + 0.5);
    double k = floor((y - lattice->origin.y) / LATTICE_MM + 0.5);
    bool there = i >= 0 && i < lattice->wide && k >= 0 && k < lattice->deep;
    return there ? (int)k * lattice->wide + (int)i : -1;
}

// ---- where columns meet a mesh ------------------------------------------------------------------

// Whether a line along +x from (x, y) crosses an edge: 1 upwards, -1 downwards. Exactly opposite
// for the edge's other direction, so that no column slips between two triangles of a closed mesh,
// and none counts twice.
static int edge_crossing(vec3 a, vec3 b, double x, double y) {
    bool a_above = a.y > y, b_above = b.y > y;
    if (a_above == b_above)
        return 0;
    vec3 low = a_above ? b : a, high = a_above ? a : b;
    double left = (high.x - low.x) * (y - low.y) - (x - low.x) * (high.y - low.y);
    return left <= 0 ? 0 : b_above ? 1 : -1;
}

static double height_at(const vec3 c[3], double x, double y) {
    vec3 normal = vec3_cross(vec3_sub(c[1], c[0]), vec3_sub(c[2], c[0]));
    double z = c[0].z - (normal.x * (x - c[0].x) + normal.y * (y - c[0].y)) / normal.z;
    return fmax(fmin(z, fmax(fmax(c[0].z, c[1].z), c[2].z)), fmin(fmin(c[0].z, c[1].z), c[2].z));
}

// side: 1 where the column leaves the mesh at this height, -1 where it enters.
typedef void lattice_meet(void *context, int column, int side, double height);

static struct column_range each_meeting(const struct lattice *lattice, const struct mesh *mesh,
                                        lattice_meet *meet, void *context) {
    struct column_range all = {INT_MAX, -1, INT_MAX, -1};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 c[3];
        view_corners(&lattice->view, mesh, t, c);
        struct column_range range = range_of(lattice, c, 3);
        range_join(&all, &range);
        for (int k = range.y_low; k <= range.y_high; k++)
            for (int i = range.x_low; i <= range.x_high; i++) {
                double x = lattice->origin.x + LATTICE_MM * i;
                double y = lattice->origin.y + LATTICE_MM * k;
                int side = edge_crossing(c[0], c[1], x, y) + edge_crossing(c[1], c[2], x, y) +
                           edge_crossing(c[2], c[0], x, y);
                if (side)
                    meet(context, k * lattice->wide + i, side, height_at(c, x, y));
            }
    }
    return all;
}

// The first step that lies above a height.
static int step_above(const struct lattice *lattice, double height) {
    return (int)ceil((height - lattice->origin.z) / LATTICE_MM);
}

// ---- making it ----------------------------------------------------------------------------------

// While columns are measured, `first` is the first step above their samples.
static void measure(void *context, int column, int side, double height) {
    struct lattice *lattice = context;
    struct lattice_column *c = &lattice->columns[column];
    int step = step_above(lattice, height);
    (void)side;
    c->count = 1;
    c->low = step < c->low ? step : c->low;
    c->first = (uint32_t)step > c->first ? (uint32_t)step : c->first;
}

static void frame_mesh(struct lattice *lattice, const struct mesh *mesh) {
    vec3 low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, 0};
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = view_point(&lattice->view, mesh_vertex(mesh, v));
        low = (vec3){fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z)};
        high = (vec3){fmax(high.x, p.x), fmax(high.y, p.y), 0};
    }
    vec3 half = {LATTICE_MM / 2, LATTICE_MM / 2, LATTICE_MM / 2};
    lattice->origin = vec3_add(low, half);
    lattice->wide = (int)ceil((high.x - low.x) / LATTICE_MM);
    lattice->deep = (int)ceil((high.y - low.y) / LATTICE_MM);
}

void lattice_init(struct lattice *lattice, const struct plan_view *view, const struct mesh *mesh) {
    *lattice = (struct lattice){.view = *view};
    frame_mesh(lattice, mesh);
    int count = lattice_column_count(lattice);
    lattice->columns = alloc((size_t)count, sizeof *lattice->columns);
    for (int i = 0; i < count; i++)
        lattice->columns[i].low = INT32_MAX;
    each_meeting(lattice, mesh, measure, lattice);
    for (int i = 0; i < count; i++) {
        struct lattice_column *c = &lattice->columns[i];
        c->low = c->count ? c->low : 0;
        c->count = (int32_t)c->first - c->low;
        c->first = lattice->sample_count;
        lattice->sample_count += (uint32_t)c->count;
    }
}

void lattice_fini(struct lattice *lattice) {
    free(lattice->columns);
    *lattice = (struct lattice){0};
}

// ---- what is inside -----------------------------------------------------------------------------

// Samples of a column from step `low` on and below step `high`.
static void visit_steps(const struct lattice *lattice, int column, int low, int high,
                        lattice_visit *visit, void *context) {
    const struct lattice_column *c = &lattice->columns[column];
    int begin = low > c->low ? low - c->low : 0;
    int end = high < c->low + c->count ? high - c->low : c->count;
    if (begin < end)
        visit(context, column, c->first + (uint32_t)begin, c->first + (uint32_t)end);
}

// From where to where a line along z is inside all planes, which are the view's.
static bool line_in_planes(const struct plane *planes, int count, double x, double y,
                           double *out_low, double *out_high) {
    double low = -1e6, high = 1e6;
    for (int i = 0; i < count; i++) {
        vec3 n = planes[i].normal;
        double room = planes[i].offset - n.x * x - n.y * y;
        if (n.z > 1e-12)
            high = fmin(high, room / n.z);
        else if (n.z < -1e-12)
            low = fmax(low, room / n.z);
        else if (room < 0)
            return false;
    }
    *out_low = low;
    *out_high = high;
    return low <= high;
}

void lattice_in_convex(const struct lattice *lattice, const struct convex *convex,
                       lattice_visit *visit, void *context) {
    vec3 vertices[CONVEX_VERTICES_MAX];
    struct plane planes[CONVEX_PLANES_MAX];
    for (int i = 0; i < convex->vertex_count; i++)
        vertices[i] = view_point(&lattice->view, convex->vertices[i]);
    for (int i = 0; i < convex->plane_count; i++) {
        const struct plane *p = &convex->planes[i];
        planes[i].normal = mat3_apply(lattice->view.axes, p->normal);
        planes[i].offset = p->offset - vec3_dot(p->normal, lattice->view.origin);
    }
    struct column_range range = range_of(lattice, vertices, convex->vertex_count);
    for (int k = range.y_low; k <= range.y_high; k++)
        for (int i = range.x_low; i <= range.x_high; i++) {
            double low, high, x = lattice->origin.x + LATTICE_MM * i;
            double y = lattice->origin.y + LATTICE_MM * k;
            if (line_in_planes(planes, convex->plane_count, x, y, &low, &high))
                visit_steps(lattice, k * lattice->wide + i, step_above(lattice, low),
                            step_above(lattice, high), visit, context);
        }
}

struct wind {
    const struct lattice *lattice;
    int8_t *windings;
};

// Samples below the height are inside once more, or once less.
static void wind(void *context, int column, int side, double height) {
    const struct wind *w = context;
    const struct lattice_column *c = &w->lattice->columns[column];
    int end = step_above(w->lattice, height) - c->low;
    for (int i = 0; i < end && i < c->count; i++)
        w->windings[c->first + (uint32_t)i] += (int8_t)side;
}

static void visit_wound(const struct lattice_column *c, int column, int8_t *windings,
                        lattice_visit *visit, void *context) {
    uint32_t end = c->first + (uint32_t)c->count;
    for (uint32_t i = c->first, begin; i < end; i++) {
        for (begin = i; i < end && windings[i] > 0; i++)
            windings[i] = 0;
        if (begin < i)
            visit(context, column, begin, i);
        if (i < end)
            windings[i] = 0;
    }
}

void lattice_in_mesh(const struct lattice *lattice, const struct mesh *mesh, int8_t *windings,
                     lattice_visit *visit, void *context) {
    struct wind w = {lattice, windings};
    struct column_range range = each_meeting(lattice, mesh, wind, &w);
    for (int k = range.y_low; k <= range.y_high; k++)
        for (int i = range.x_low; i <= range.x_high; i++) {
            int column = k * lattice->wide + i;
            visit_wound(&lattice->columns[column], column, windings, visit, context);
        }
}
