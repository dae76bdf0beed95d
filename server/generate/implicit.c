#include "generate/implicit.h"

#include "base/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RELAX_STEPS 8
#define NEWTON_STEPS 3

vec3 implicit_gradient(implicit solid, vec3 p) {
    const double h = 1e-3;
    vec3 g = {solid((vec3){p.x + h, p.y, p.z}) - solid((vec3){p.x - h, p.y, p.z}),
              solid((vec3){p.x, p.y + h, p.z}) - solid((vec3){p.x, p.y - h, p.z}),
              solid((vec3){p.x, p.y, p.z + h}) - solid((vec3){p.x, p.y, p.z - h})};
    return vec3_scale(0.5 / h, g);
}

struct grid {
    uint32_t n[3]; // corners along each axis
    double edge;
    vec3 origin;
    double *values;   // at each corner
    uint32_t *vertex; // of each cell (named by its lowest corner), or MESH_NONE
    vec3 *positions;  // of the vertices
    uint32_t *quads;  // 4 vertices each
    uint32_t vertex_count, quad_count;
    bool parted; // by part_sheets in this round
};

static size_t corner_index(const struct grid *g, const uint32_t at[3]) {
    return ((size_t)at[2] * g->n[1] + at[1]) * g->n[0] + at[0];
}

static vec3 corner_position(const struct grid *g, const uint32_t at[3]) {
    vec3 offset = {at[0] * g->edge, at[1] * g->edge, at[2] * g->edge};
    return vec3_add(g->origin, offset);
}

// Calls `visit` for each corner that has all its upper neighbours.
static void each_cell(struct grid *g, void (*visit)(struct grid *, const uint32_t at[3])) {
    uint32_t at[3];
    for (at[2] = 0; at[2] + 1 < g->n[2]; at[2]++)
        for (at[1] = 0; at[1] + 1 < g->n[1]; at[1]++)
            for (at[0] = 0; at[0] + 1 < g->n[0]; at[0]++)
                visit(g, at);
}

static void sample(struct grid *g, implicit solid) {
    uint32_t at[3];
    for (at[2] = 0; at[2] < g->n[2]; at[2]++)
        for (at[1] = 0; at[1] < g->n[1]; at[1]++)
            for (at[0] = 0; at[0] < g->n[0]; at[0]++)
                g->values[corner_index(g, at)] = solid(corner_position(g, at));
}

// Corner 0..7 of a cell: bit 0 up along x, bit 1 along y, bit 2 along z.
static size_t cell_corner(const struct grid *g, const uint32_t at[3], uint32_t corner) {
    uint32_t c[3] = {at[0] + (corner & 1), at[1] + (corner >> 1 & 1), at[2] + (corner >> 2)};
    return corner_index(g, c);
}

// Where two inside corners meet only across a face or through a cell, two sheets of the surface
// would share an edge or a vertex. Each of these tables' rows is the corners that are inside there;
// `mask` says which are looked at.
static bool two_sheets(uint32_t inside) {
    static const struct {
        uint8_t mask, pattern;
    } faces[6] = {{0x0f, 0x09}, {0xf0, 0x90}, {0x33, 0x21},
                  {0xcc, 0x84}, {0x55, 0x41}, {0xaa, 0x82}};
    for (int i = 0; i < 6; i++) {
        uint32_t seen = inside & faces[i].mask;
        if (seen == faces[i].pattern || seen == (uint32_t)(faces[i].mask ^ faces[i].pattern))
            return true;
    }
    for (uint32_t corner = 0; corner < 4; corner++) {
        uint32_t diagonal = 1u << corner | 1u << (7 - corner);
        if (inside == diagonal || inside == (0xff ^ diagonal))
            return true;
    }
    return false;
}

// Takes the inside corner that is nearest to the surface out of such a cell. Only ever taking out,
// it comes to an end; the vertices are put on the true surface later.
static void part_sheets(struct grid *g, const uint32_t at[3]) {
    for (;;) {
        uint32_t inside = 0;
        size_t shallowest = SIZE_MAX;
        for (uint32_t corner = 0; corner < 8; corner++) {
            size_t i = cell_corner(g, at, corner);
            if (g->values[i] >= 0)
                continue;
            inside |= 1u << corner;
            if (shallowest == SIZE_MAX || g->values[i] > g->values[shallowest])
                shallowest = i;
        }
        if (!two_sheets(inside))
            return;
        g->values[shallowest] = 1e-9;
        g->parted = true;
    }
}

// The vertex of a cell starts in the middle of the points where its edges cross the surface.
static void add_vertex(struct grid *g, const uint32_t at[3]) {
    vec3 sum = {0};
    int crossings = 0;
    for (uint32_t edge = 0; edge < 12; edge++) {
        uint32_t axis = edge / 4, side = edge % 4;
        uint32_t a[3] = {at[0], at[1], at[2]};
        a[(axis + 1) % 3] += side & 1;
        a[(axis + 2) % 3] += side >> 1;
        uint32_t b[3] = {a[0], a[1], a[2]};
        b[axis]++;
        double va = g->values[corner_index(g, a)], vb = g->values[corner_index(g, b)];
        if ((va < 0) == (vb < 0))
            continue;
        vec3 pa = corner_position(g, a), pb = corner_position(g, b);
        sum = vec3_add(sum, vec3_lerp(pa, pb, va / (va - vb)));
        crossings++;
    }
    if (crossings == 0)
        return;
    g->vertex[corner_index(g, at)] = g->vertex_count;
    g->positions[g->vertex_count++] = vec3_scale(1.0 / crossings, sum);
}

// Around each grid edge that crosses the surface stand four cells: their vertices make a quad.
static void add_quads(struct grid *g, const uint32_t at[3]) {
    bool inside = g->values[corner_index(g, at)] < 0;
    for (uint32_t axis = 0; axis < 3; axis++) {
        uint32_t end[3] = {at[0], at[1], at[2]};
        end[axis]++;
        uint32_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        if ((g->values[corner_index(g, end)] < 0) == inside)
            continue;
        CHECK(at[u] > 0 && at[v] > 0);
        uint32_t cells[4];
        for (int i = 0; i < 4; i++) {
            uint32_t cell[3] = {at[0], at[1], at[2]};
            cell[u] -= (i == 0 || i == 3);
            cell[v] -= i < 2;
            cells[inside ? i : 3 - i] = g->vertex[corner_index(g, cell)];
        }
        memcpy(g->quads + 4 * (size_t)g->quad_count++, cells, sizeof cells);
    }
}

static void project(implicit solid, vec3 *p) {
    for (int i = 0; i < NEWTON_STEPS; i++) {
        vec3 gradient = implicit_gradient(solid, *p);
        double steep = vec3_dot(gradient, gradient);
        if (steep > 1e-6)
            *p = vec3_add_scaled(*p, -solid(*p) / steep, gradient);
    }
}

// Moves each vertex to the mean of its neighbours along the quads' edges, then to the surface.
static void relax(struct grid *g, implicit solid) {
    vec3 *sum = alloc(g->vertex_count, sizeof *sum);
    uint32_t *count = alloc(g->vertex_count, sizeof *count);
    for (size_t q = 0; q < g->quad_count; q++)
        for (size_t i = 0; i < 4; i++) {
            uint32_t a = g->quads[4 * q + i], b = g->quads[4 * q + (i + 1) % 4];
            sum[a] = vec3_add(sum[a], g->positions[b]);
            count[a]++;
        }
    for (uint32_t v = 0; v < g->vertex_count; v++) {
        g->positions[v] = vec3_scale(1.0 / count[v], sum[v]);
        project(solid, &g->positions[v]);
    }
    free(sum);
    free(count);
}

static void split_quads(const struct grid *g, struct mesh *out_mesh) {
    mesh_init(out_mesh, g->vertex_count, 2 * g->quad_count);
    for (uint32_t v = 0; v < g->vertex_count; v++)
        mesh_set_vertex(out_mesh, v, g->positions[v]);
    for (size_t q = 0; q < g->quad_count; q++) {
        const uint32_t *c = g->quads + 4 * q;
        bool first = vec3_distance(g->positions[c[0]], g->positions[c[2]]) <=
                     vec3_distance(g->positions[c[1]], g->positions[c[3]]);
        uint32_t along02[6] = {c[0], c[1], c[2], c[0], c[2], c[3]};
        uint32_t along13[6] = {c[0], c[1], c[3], c[1], c[2], c[3]};
        memcpy(out_mesh->triangles + 6 * q, first ? along02 : along13, sizeof along02);
    }
}

void implicit_mesh(implicit solid, struct box box, double edge, struct mesh *out_mesh) {
    vec3 size = vec3_sub(box.max, box.min);
    struct grid g = {.edge = edge, .origin = box.min};
    g.n[0] = (uint32_t)ceil(size.x / edge) + 1;
    g.n[1] = (uint32_t)ceil(size.y / edge) + 1;
    g.n[2] = (uint32_t)ceil(size.z / edge) + 1;
    size_t corners = (size_t)g.n[0] * g.n[1] * g.n[2];
    g.values = alloc(corners, sizeof *g.values);
    g.vertex = alloc(corners, sizeof *g.vertex);
    g.positions = alloc(corners, sizeof *g.positions);
    g.quads = alloc(3 * corners, 4 * sizeof *g.quads);
    memset(g.vertex, 0xff, corners * sizeof *g.vertex);
    sample(&g, solid);
    do {
        g.parted = false;
        each_cell(&g, part_sheets);
    } while (g.parted);
    each_cell(&g, add_vertex);
    each_cell(&g, add_quads);
    for (uint32_t v = 0; v < g.vertex_count; v++)
        project(solid, &g.positions[v]);
    for (int i = 0; i < RELAX_STEPS; i++)
        relax(&g, solid);
    split_quads(&g, out_mesh);
    free(g.values);
    free(g.vertex);
    free(g.positions);
    free(g.quads);
}
