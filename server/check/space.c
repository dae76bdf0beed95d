#include "check/space.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

// So that made meshes, whose corners like round numbers, do not meet the grid's lines.
#define SHIFT 0.37

// Through its hole an open surface shows its back to what is outside, too.
#define OPEN_VOTES 2

size_t space_count(const struct space *space) {
    return (size_t)space->size[0] * (size_t)space->size[1] * (size_t)space->size[2];
}

static double component(vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

// ---- where lines along an axis meet a surface ---------------------------------------------------

// The lines along one axis; u and v are the other two, cyclically. For each line, and each step
// along it, which way the surface faces that is met between the node before and the node of that
// step: 1 forwards, -1 backwards. The first step holds all that lies before, the last all beyond.
struct lines {
    int axis, u, v;
    int8_t *sides;
};

// As in quality/lattice.c: opposite for the edge's other direction, so that no line slips between
// two triangles of a closed surface and none counts twice.
static int edge_side(const double a[2], const double b[2], double u, double v) {
    bool a_above = a[1] > v, b_above = b[1] > v;
    if (a_above == b_above)
        return 0;
    const double *low = a_above ? b : a, *high = a_above ? a : b;
    double left = (high[0] - low[0]) * (v - low[1]) - (u - low[0]) * (high[1] - low[1]);
    return left <= 0 ? 0 : b_above ? 1 : -1;
}

struct facet {
    vec3 corners[3];
    double plan[3][2]; // the corners across the lines
    double normal[3];  // along the axis, u, v
};

static struct facet facet_of(const struct lines *lines, const struct mesh *mesh, pose T,
                             uint32_t triangle) {
    struct facet f;
    for (int i = 0; i < 3; i++) {
        f.corners[i] = pose_apply(T, mesh_corner(mesh, triangle, i));
        f.plan[i][0] = component(f.corners[i], lines->u);
        f.plan[i][1] = component(f.corners[i], lines->v);
    }
    vec3 n = vec3_cross(vec3_sub(f.corners[1], f.corners[0]), vec3_sub(f.corners[2], f.corners[0]));
    f.normal[0] = component(n, lines->axis);
    f.normal[1] = component(n, lines->u);
    f.normal[2] = component(n, lines->v);
    return f;
}

static double height_of(const struct facet *f, int axis, double u, double v) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < 3; i++) {
        low = fmin(low, component(f->corners[i], axis));
        high = fmax(high, component(f->corners[i], axis));
    }
    double rise = f->normal[1] * (u - f->plan[0][0]) + f->normal[2] * (v - f->plan[0][1]);
    return fmin(fmax(component(f->corners[0], axis) - rise / f->normal[0], low), high);
}

// Nodes of an axis from `low` to `high`.
static void range_of(const struct space *s, int axis, double low, double high, int out[2]) {
    double origin = component(s->origin, axis), last = s->size[axis] - 1;
    out[0] = (int)fmin(fmax(ceil((low - origin) / s->spacing_mm), 0), last + 1);
    out[1] = (int)fmax(fmin(floor((high - origin) / s->spacing_mm), last), -1);
}

// Held at the ends of its range: surfaces may lie on each other many times.
static int8_t add_held(int a, int b) {
    int sum = a + b;
    return (int8_t)(sum < INT8_MIN ? INT8_MIN : sum > INT8_MAX ? INT8_MAX : sum);
}

static void meet(const struct space *s, const struct lines *lines, const struct facet *f, int i,
                 int k) {
    double u = component(s->origin, lines->u) + s->spacing_mm * i;
    double v = component(s->origin, lines->v) + s->spacing_mm * k;
    int side = edge_side(f->plan[0], f->plan[1], u, v) + edge_side(f->plan[1], f->plan[2], u, v) +
               edge_side(f->plan[2], f->plan[0], u, v);
    if (!side)
        return;
    double at = (height_of(f, lines->axis, u, v) - component(s->origin, lines->axis));
    int step = (int)fmin(fmax(ceil(at / s->spacing_mm), 0), s->size[lines->axis]);
    size_t line = (size_t)i + (size_t)s->size[lines->u] * (size_t)k;
    int8_t *met = &lines->sides[line * ((size_t)s->size[lines->axis] + 1) + (size_t)step];
    *met = add_held(*met, side);
}

static struct lines lines_meet(const struct space *s, int axis, const struct mesh *mesh, pose T) {
    struct lines lines = {axis, (axis + 1) % 3, (axis + 2) % 3, NULL};
    lines.sides = alloc(space_count(s) / (size_t)s->size[axis] * ((size_t)s->size[axis] + 1), 1);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        struct facet f = facet_of(&lines, mesh, T, t);
        int i[2], k[2];
        double(*p)[2] = f.plan;
        range_of(s, lines.u, fmin(fmin(p[0][0], p[1][0]), p[2][0]),
                 fmax(fmax(p[0][0], p[1][0]), p[2][0]), i);
        range_of(s, lines.v, fmin(fmin(p[0][1], p[1][1]), p[2][1]),
                 fmax(fmax(p[0][1], p[1][1]), p[2][1]), k);
        for (int b = k[0]; b <= k[1]; b++)
            for (int a = i[0]; a <= i[1]; a++)
                meet(s, &lines, &f, a, b);
    }
    return lines;
}

// ---- what is inside -----------------------------------------------------------------------------

static size_t node_on(const struct space *s, const struct lines *lines, size_t line, int step) {
    int at[3];
    at[lines->axis] = step;
    at[lines->u] = (int)(line % (size_t)s->size[lines->u]);
    at[lines->v] = (int)(line / (size_t)s->size[lines->u]);
    return space_node(s, at[0], at[1], at[2]);
}

// Votes for inside; those of a closed surface are its winding number.
static void count_windings(const struct space *s, const struct lines *lines, int8_t *votes) {
    int steps = s->size[lines->axis];
    size_t line_count = space_count(s) / (size_t)steps;
    for (size_t line = 0; line < line_count; line++) {
        const int8_t *sides = lines->sides + line * ((size_t)steps + 1);
        int winding = 0;
        for (int step = 0; step < steps; step++) {
            winding -= sides[step];
            votes[node_on(s, lines, line, step)] = add_held(winding, 0);
        }
    }
}

static int sign(int value) {
    return (value > 0) - (value < 0);
}

// What is met first, backwards and forwards along each line.
static void count_backs(const struct space *s, const struct lines *lines, int8_t *votes) {
    int steps = s->size[lines->axis];
    size_t line_count = space_count(s) / (size_t)steps;
    for (size_t line = 0; line < line_count; line++) {
        const int8_t *sides = lines->sides + line * ((size_t)steps + 1);
        int met = 0;
        for (int step = 0; step < steps; step++) {
            met = sides[step] ? -sign(sides[step]) : met;
            votes[node_on(s, lines, line, step)] += (int8_t)met;
        }
        met = 0;
        for (int step = steps - 1; step >= 0; step--) {
            met = sides[step + 1] ? sign(sides[step + 1]) : met;
            votes[node_on(s, lines, line, step)] += (int8_t)met;
        }
    }
}

static void vote(const struct space *s, const struct mesh *mesh, pose T, bool open, int8_t *votes) {
    memset(votes, open ? 1 - OPEN_VOTES : 0, space_count(s));
    for (int axis = open ? 0 : 2; axis < 3; axis++) {
        struct lines lines = lines_meet(s, axis, mesh, T);
        if (open)
            count_backs(s, &lines, votes);
        else
            count_windings(s, &lines, votes);
        free(lines.sides);
    }
}

// A solid wins over the outside: a bone that sticks out of the skin is a bone.
static void mark(struct space *s, enum space_role role, const int8_t *votes) {
    size_t count = space_count(s);
    for (size_t n = 0; n < count; n++) {
        if (role == SPACE_SOLID && votes[n] > 0)
            s->places[n] = PLACE_SOLID;
        else if (role == SPACE_SKIN && votes[n] <= 0 && s->places[n] == PLACE_FREE)
            s->places[n] = PLACE_OUTSIDE;
    }
}

static void mark_planes(struct space *s, const struct plane *planes, int count) {
    for (int k = 0; k < s->size[2]; k++)
        for (int j = 0; j < s->size[1]; j++)
            for (int i = 0; i < s->size[0]; i++) {
                uint8_t *place = &s->places[space_node(s, i, j, k)];
                vec3 p = space_at(s, i, j, k);
                for (int n = 0; n < count && *place == PLACE_FREE; n++)
                    if (vec3_dot(planes[n].normal, p) > planes[n].offset)
                        *place = PLACE_OUTSIDE;
            }
}

static enum result size_of(const struct space_setup *setup, struct space *s, struct error *err) {
    double step = setup->spacing_mm, nodes = 1;
    for (int axis = 0; axis < 3; axis++) {
        double low = ceil(component(setup->box.min, axis) / step - SHIFT);
        double high = floor(component(setup->box.max, axis) / step - SHIFT);
        double count = fmax(high - low + 1, 1);
        nodes *= count;
        if (!(nodes <= SPACE_NODES_MAX))
            return fail(err, RESULT_LIMIT, "more than %d nodes of %g mm", SPACE_NODES_MAX, step);
        s->size[axis] = (int)count;
        double *origin = axis == 0 ? &s->origin.x : axis == 1 ? &s->origin.y : &s->origin.z;
        *origin = (low + SHIFT) * step;
    }
    return RESULT_OK;
}

enum result space_init(const struct space_setup *setup, struct space *out, struct error *err) {
    *out = (struct space){.spacing_mm = setup->spacing_mm};
    enum result result = size_of(setup, out, err);
    if (result != RESULT_OK)
        return result;
    const struct warp_scene *scene = setup->scene;
    out->places = alloc(space_count(out), 1);
    int8_t *votes = alloc(space_count(out), 1);
    for (int i = 0; i < scene->surface_count; i++) {
        const struct warp_surface *surface = &scene->surfaces[i];
        const struct space_surface *as = &setup->surfaces[i];
        vote(out, as->whole ? as->whole : surface->mesh, scene->T_world_body[surface->body],
             as->open, votes);
        mark(out, as->role, votes);
    }
    free(votes);
    mark_planes(out, setup->planes, setup->plane_count);
    return RESULT_OK;
}

void space_fini(struct space *space) {
    free(space->places);
    *space = (struct space){0};
}

// ---- pockets ------------------------------------------------------------------------------------

struct pocket_flood {
    struct space *space;
    size_t count, room;
    uint32_t *nodes; // to be gone on from
};

// A pocket until it is reached.
static void reach(struct pocket_flood *flood, size_t node) {
    uint8_t *place = &flood->space->places[node];
    if (*place != PLACE_POCKET)
        return;
    *place = PLACE_FREE;
    if (flood->count == flood->room) {
        flood->room = 2 * flood->room + 1024;
        flood->nodes = alloc_resize(flood->nodes, flood->room, sizeof *flood->nodes);
    }
    flood->nodes[flood->count++] = (uint32_t)node;
}

static void each_neighbour(struct pocket_flood *flood, size_t node) {
    const int *size = flood->space->size;
    size_t stride = 1, rest = node;
    for (int axis = 0; axis < 3; axis++) {
        size_t at = rest % (size_t)size[axis];
        rest /= (size_t)size[axis];
        if (at > 0)
            reach(flood, node - stride);
        if (at + 1 < (size_t)size[axis])
            reach(flood, node + stride);
        stride *= (size_t)size[axis];
    }
}

static bool at_border(const struct space *s, int i, int j, int k) {
    return i == 0 || j == 0 || k == 0 || i == s->size[0] - 1 || j == s->size[1] - 1 ||
           k == s->size[2] - 1;
}

void space_find_pockets(struct space *s) {
    struct pocket_flood flood = {.space = s};
    size_t count = space_count(s);
    for (size_t n = 0; n < count; n++)
        if (s->places[n] == PLACE_FREE)
            s->places[n] = PLACE_POCKET;
    for (int k = 0; k < s->size[2]; k++)
        for (int j = 0; j < s->size[1]; j++)
            for (int i = 0; i < s->size[0]; i++) {
                size_t node = space_node(s, i, j, k);
                if (at_border(s, i, j, k))
                    reach(&flood, node);
                if (s->places[node] == PLACE_OUTSIDE)
                    each_neighbour(&flood, node);
            }
    while (flood.count)
        each_neighbour(&flood, flood.nodes[--flood.count]);
    free(flood.nodes);
}
