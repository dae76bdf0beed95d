#include "cut/stage.h"

#include "cut/fill.h"

#include <stdlib.h>
#include <string.h>

// ---- the blade's place ----
//
// Each plane moves outwards by a hair, more or less by a part that depends on its direction alone.
// So blades and meshes on one lattice are in general position, neighbouring bites overlap rather
// than leave a skin, and planes that were one plane remain one.

#define GROWTH_MM 1e-7
#define GROWTH_MORE_MM 3e-6 // with each attempt

static const vec3 leans[CUT_ATTEMPTS] = {
    {0.2741, 0.1413, -0.3719}, {-0.3187, 0.2233, 0.1091},   {0.1531, -0.3361, 0.2297},
    {0.3413, 0.1879, 0.2083},  {-0.2129, -0.1637, -0.3529}, {0.0967, 0.3727, -0.2549},
    {-0.3571, 0.0821, 0.3023}, {0.2339, -0.2927, -0.1223},  {-0.1097, 0.3167, 0.2671}};

// What a vertex moves by where each of its planes moves outwards by one: (Σ n nᵀ) m = Σ n.
static vec3 mitre(const vec3 columns[3], vec3 sum) {
    vec3 minors = vec3_cross(columns[1], columns[2]);
    double determinant = vec3_dot(columns[0], minors);
    if (determinant < 1e-9)
        return vec3_unit_or(sum, (vec3){0});
    return vec3_scale(1 / determinant, (vec3){vec3_dot(sum, minors),
                                              vec3_dot(columns[0], vec3_cross(sum, columns[2])),
                                              vec3_dot(columns[0], vec3_cross(columns[1], sum))});
}

static void add_normal(vec3 columns[3], vec3 *sum, vec3 n) {
    columns[0] = vec3_add_scaled(columns[0], n.x, n);
    columns[1] = vec3_add_scaled(columns[1], n.y, n);
    columns[2] = vec3_add_scaled(columns[2], n.z, n);
    *sum = vec3_add(*sum, n);
}

static void grow(struct convex *blade, double growth) {
    vec3 columns[CONVEX_VERTICES_MAX][3] = {0}, sums[CONVEX_VERTICES_MAX] = {0};
    for (int f = 0; f < blade->plane_count; f++) {
        blade->planes[f].offset += growth;
        for (int i = blade->first_corner[f]; i < blade->first_corner[f + 1]; i++)
            add_normal(columns[blade->corners[i]], &sums[blade->corners[i]],
                       blade->planes[f].normal);
    }
    for (int v = 0; v < blade->vertex_count; v++)
        blade->vertices[v] =
            vec3_add_scaled(blade->vertices[v], growth, mitre(columns[v], sums[v]));
}

static void shift_by(struct convex *blade, vec3 shift) {
    for (int f = 0; f < blade->plane_count; f++)
        blade->planes[f].offset += vec3_dot(blade->planes[f].normal, shift);
    for (int v = 0; v < blade->vertex_count; v++)
        blade->vertices[v] = vec3_add(blade->vertices[v], shift);
    blade->box.min = vec3_add(blade->box.min, shift);
    blade->box.max = vec3_add(blade->box.max, shift);
}

static void connect_faces(struct stage *stage) {
    memset(stage->edge_between, 0xff, sizeof stage->edge_between);
    memset(stage->beside, 0, sizeof stage->beside);
    for (int e = 0; e < stage->blade.edge_count; e++) {
        int left = stage->blade.edges[e].left, right = stage->blade.edges[e].right;
        stage->edge_between[left][right] = stage->edge_between[right][left] = (int16_t)e;
        stage->beside[left] |= UINT64_C(1) << right;
        stage->beside[right] |= UINT64_C(1) << left;
    }
}

void stage_begin(struct stage *stage, const struct convex *part, int attempt) {
    double growth = GROWTH_MM + attempt * GROWTH_MORE_MM;
    stage->blade = *part;
    grow(&stage->blade, growth);
    shift_by(&stage->blade, vec3_scale(growth, leans[attempt]));
    connect_faces(stage);
    stage->refusal = NULL;
    stage->taken.count = stage->ring_vertices.count = 0;
    stage->edge_count = stage->piercing_count = stage->segment_count = 0;
    stage->region_count = stage->ring_count = stage->made_count = 0;
}

// ---- what the steps add ----

bool stage_refuse(struct stage *stage, const char *why) {
    stage->refusal = why;
    return false;
}

uint32_t stage_take_vertex(struct cut_mesh *mesh, struct stage *stage, vec3 point) {
    uint32_t id = tissue_take_vertex(mesh, point);
    ids_push(&stage->taken, id);
    return id;
}

void stage_add_segment(struct stage *stage, int face, uint32_t from, uint32_t to) {
    stage->segments = array_grow(stage->segments, &stage->segment_room, stage->segment_count + 1,
                                 sizeof *stage->segments);
    stage->segments[stage->segment_count++] = (struct segment){face, from, to};
}

void stage_add_piercing(struct stage *stage, struct piercing piercing) {
    stage->piercings = array_grow(stage->piercings, &stage->piercing_room,
                                  stage->piercing_count + 1, sizeof *stage->piercings);
    stage->piercings[stage->piercing_count++] = piercing;
}

void stage_add_region(struct stage *stage, uint32_t label, vec3 normal) {
    stage->regions = array_grow(stage->regions, &stage->region_room, stage->region_count + 1,
                                sizeof *stage->regions);
    stage->regions[stage->region_count++] = (struct region){stage->ring_count, 0, label, normal};
}

void stage_begin_ring(struct stage *stage) {
    stage->rings =
        array_grow(stage->rings, &stage->ring_room, stage->ring_count + 1, sizeof *stage->rings);
    stage->rings[stage->ring_count++] = (struct ring){stage->ring_vertices.count, 0};
    stage->regions[stage->region_count - 1].ring_count++;
}

void stage_add_to_ring(struct stage *stage, uint32_t vertex) {
    ids_push(&stage->ring_vertices, vertex);
    stage->rings[stage->ring_count - 1].count++;
}

// ---- memory ----

struct stage *stage_create(void) {
    struct stage *stage = alloc(1, sizeof *stage);
    stage->filler = filler_create();
    return stage;
}

void stage_destroy(struct stage **stage) {
    struct stage *s = *stage;
    *stage = NULL;
    marks_fini(&s->slots);
    ids_fini(&s->candidates);
    ids_fini(&s->taken);
    ids_fini(&s->pierced);
    ids_fini(&s->ring_vertices);
    free(s->vertices);
    free(s->values);
    free(s->triangles);
    free(s->edges);
    free(s->piercings);
    free(s->segments);
    free(s->regions);
    free(s->rings);
    free(s->made);
    filler_destroy(&s->filler);
    ids_fini(&s->made_ids);
    sides_fini(&s->drawn);
    sides_fini(&s->sides);
    free(s);
}
