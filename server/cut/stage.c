#include "cut/stage.h"

#include "cut/edit.h"
#include "cut/polygon.h"

#include <stdlib.h>
#include <string.h>

// ---- the blade's place ----
//
// Each blade grows and moves by a hair of its own: its nearest faces by about GROWTH_MM, the others
// in proportion. So no plane, edge or vertex of it coincides with one of an earlier blade or of a
// lattice, and flush bites overlap rather than leave a skin.

#define GROWTH_MM 5e-7
#define GROWTH_MORE_MM 2e-6 // with each further attempt
#define GROWTH_MOST 1e-5    // of the size of a blade
#define SPREAD 0.05         // of the growth, both ways

// Splitmix64, as a number from -1 to 1.
static double draw_number(uint64_t *state) {
    uint64_t z = (*state += UINT64_C(0x9e3779b97f4a7c15));
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

static vec3 centre_of(const struct convex *blade) {
    vec3 sum = {0};
    for (int v = 0; v < blade->vertex_count; v++)
        sum = vec3_add(sum, blade->vertices[v]);
    return vec3_scale(1.0 / blade->vertex_count, sum);
}

static double least_depth(const struct convex *blade, vec3 centre) {
    double least = INFINITY;
    for (int f = 0; f < blade->plane_count; f++)
        least = lower(least, blade->planes[f].offset - vec3_dot(blade->planes[f].normal, centre));
    return least;
}

static void set_box(struct convex *blade) {
    struct box *box = &blade->box;
    *box = (struct box){blade->vertices[0], blade->vertices[0]};
    for (int v = 1; v < blade->vertex_count; v++) {
        vec3 p = blade->vertices[v];
        box->min = (vec3){lower(box->min.x, p.x), lower(box->min.y, p.y), lower(box->min.z, p.z)};
        box->max =
            (vec3){higher(box->max.x, p.x), higher(box->max.y, p.y), higher(box->max.z, p.z)};
    }
}

// By scaling, as then all planes that met in a vertex still do.
static void place(struct convex *blade, uint64_t seed, int attempt) {
    double size = GROWTH_MM + attempt * GROWTH_MORE_MM;
    vec3 centre = centre_of(blade), lean;
    lean.x = SPREAD * size * draw_number(&seed);
    lean.y = SPREAD * size * draw_number(&seed);
    lean.z = SPREAD * size * draw_number(&seed);
    double growth = size * (1 + SPREAD * draw_number(&seed)) / least_depth(blade, centre);
    growth = growth < GROWTH_MOST ? growth : GROWTH_MOST;
    for (int f = 0; f < blade->plane_count; f++) {
        struct plane *plane = &blade->planes[f];
        plane->offset += growth * (plane->offset - vec3_dot(plane->normal, centre)) +
                         vec3_dot(plane->normal, lean);
    }
    for (int v = 0; v < blade->vertex_count; v++) {
        vec3 out = vec3_scale(growth, vec3_sub(blade->vertices[v], centre));
        blade->vertices[v] = vec3_add(blade->vertices[v], vec3_add(out, lean));
    }
    set_box(blade);
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

void stage_begin(struct stage *stage, const struct convex *part, uint64_t seed, int attempt) {
    stage->blade = *part;
    place(&stage->blade, seed, attempt);
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
    uint32_t id = edit_take_vertex(mesh, point);
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
    stage->rings[stage->ring_count++] = (struct vertex_ring){stage->ring_vertices.count, 0};
    stage->regions[stage->region_count - 1].ring_count++;
}

void stage_add_to_ring(struct stage *stage, uint32_t vertex) {
    ids_push(&stage->ring_vertices, vertex);
    stage->rings[stage->ring_count - 1].count++;
}

// ---- memory ----

struct stage *stage_create(void) {
    struct stage *stage = alloc(1, sizeof *stage);
    stage->filler = polygon_create();
    return stage;
}

void stage_destroy(struct stage **stage) {
    struct stage *s = *stage;
    *stage = NULL;
    stamped_set_fini(&s->slots);
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
    free(s->loops);
    free(s->made);
    free(s->backs);
    polygon_destroy(&s->filler);
    ids_fini(&s->made_ids);
    sides_fini(&s->drawn);
    sides_fini(&s->sides);
    free(s);
}
