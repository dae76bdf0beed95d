#include "cut/link.h"

#include "cut/stage.h"

#include <stdlib.h>
#include <string.h>

#define ROUNDS 6

// Directed sides by their ends: those of the new triangles, by 3 k + i, and the sides of living
// neighbours that look at a triangle that goes, by their side in the mesh.
struct linker {
    struct directed {
        uint32_t from, to;
        uint32_t side;
        bool living, matched;
    } * table; // from MESH_NONE: empty
    uint32_t room, mask;
    struct ids doubled; // new sides that run like another one
    struct ids sides;   // of the new triangles, once they are in the mesh
};

struct linker *linker_create(void) {
    return alloc(1, sizeof(struct linker));
}

void linker_destroy(struct linker **linker) {
    free((*linker)->table);
    ids_fini(&(*linker)->doubled);
    ids_fini(&(*linker)->sides);
    free(*linker);
    *linker = NULL;
}

// ---- the table ----

static void clear_table(struct linker *linker, uint32_t sides) {
    uint32_t size = 64;
    while (size < 2 * sides)
        size *= 2;
    linker->table = array_grow(linker->table, &linker->room, size, sizeof *linker->table);
    linker->mask = size - 1;
    memset(linker->table, 0xff, size * sizeof *linker->table);
}

static struct directed *place_of(struct linker *linker, uint32_t from, uint32_t to) {
    uint64_t mixed = (((uint64_t)from << 32) | to) * UINT64_C(0x9e3779b97f4a7c15);
    uint32_t i = (uint32_t)(mixed >> 32) & linker->mask;
    while (linker->table[i].from != MESH_NONE &&
           (linker->table[i].from != from || linker->table[i].to != to))
        i = (i + 1) & linker->mask;
    return &linker->table[i];
}

static bool enter(struct linker *linker, uint32_t from, uint32_t to, uint32_t side, bool living) {
    struct directed *place = place_of(linker, from, to);
    if (place->from != MESH_NONE)
        return false;
    *place = (struct directed){from, to, side, living, false};
    return true;
}

// ---- sides that run alike: the diagonal among them gets a vertex in its middle ----

static bool goes(const struct stage *stage, uint32_t triangle) {
    return marks_has(&stage->slots, triangle);
}

static bool enter_border(const struct cut_mesh *mesh, struct stage *stage) {
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        for (uint32_t i = 0; stage->triangles[k].goes && i < 3; i++) {
            uint32_t twin = mesh->twins[3 * stage->triangles[k].id + i];
            if (!goes(stage, twin / 3) &&
                !enter(stage->linker, mesh->corners[twin], side_end(mesh, twin), twin, true))
                return stage_refuse(stage, "two neighbours of the cut run alike");
        }
    return true;
}

static bool enter_all(const struct cut_mesh *mesh, struct stage *stage) {
    struct linker *linker = stage->linker;
    linker->doubled.count = 0;
    clear_table(linker, 3 * (stage->made_count + stage->triangle_count));
    if (!enter_border(mesh, stage))
        return false;
    for (uint32_t s = 0; s < 3 * stage->made_count; s++) {
        const uint32_t *c = stage->made[s / 3].corners;
        if (!enter(linker, c[s % 3], c[(s + 1) % 3], s, false))
            ids_push(&linker->doubled, s);
    }
    return true;
}

// The new triangle of the same region on the other side of a new side; MESH_NONE at its border.
static uint32_t across(const struct stage *stage, uint32_t side) {
    const struct new_triangle *t = &stage->made[side / 3];
    uint32_t from = t->corners[side % 3], to = t->corners[(side + 1) % 3];
    for (uint32_t k = 0; k < stage->made_count; k++)
        for (uint32_t i = 0; stage->made[k].region == t->region && i < 3; i++)
            if (stage->made[k].corners[i] == to && stage->made[k].corners[(i + 1) % 3] == from)
                return 3 * k + i;
    return MESH_NONE;
}

static void split(struct stage *stage, uint32_t side, uint32_t middle) {
    stage->made =
        array_grow(stage->made, &stage->made_room, stage->made_count + 1, sizeof *stage->made);
    struct new_triangle *t = &stage->made[side / 3];
    struct new_triangle second = *t;
    t->corners[(side + 1) % 3] = middle;
    second.corners[side % 3] = middle;
    stage->made[stage->made_count++] = second;
}

static bool split_diagonal(struct cut_mesh *mesh, struct stage *stage, uint32_t side) {
    uint32_t back = across(stage, side);
    if (back == MESH_NONE)
        return false;
    const uint32_t *c = stage->made[side / 3].corners;
    vec3 a = mesh->points[c[side % 3]], b = mesh->points[c[(side + 1) % 3]];
    uint32_t middle = stage_take_vertex(mesh, stage, vec3_lerp(a, b, 0.5));
    split(stage, side, middle);
    split(stage, back, middle);
    return true;
}

static bool runs(const struct stage *stage, uint32_t side, uint32_t from, uint32_t to) {
    const uint32_t *c = stage->made[side / 3].corners;
    return c[side % 3] == from && c[(side + 1) % 3] == to;
}

// Sides that a split has moved wait for the next round.
static bool part_doubled(struct cut_mesh *mesh, struct stage *stage) {
    struct linker *linker = stage->linker;
    for (uint32_t d = 0; d < linker->doubled.count; d++) {
        uint32_t side = linker->doubled.at[d];
        const uint32_t *c = stage->made[side / 3].corners;
        uint32_t from = c[side % 3], to = c[(side + 1) % 3];
        const struct directed *first = place_of(linker, from, to);
        if (first->from == MESH_NONE || (!first->living && !runs(stage, first->side, from, to)))
            continue;
        if (!split_diagonal(mesh, stage, side) &&
            (first->living || !split_diagonal(mesh, stage, first->side)))
            return stage_refuse(stage, "two borders of new surface run alike");
    }
    return true;
}

// ---- all sides find their other side ----

static bool match_sides(struct stage *stage) {
    struct linker *linker = stage->linker;
    for (uint32_t s = 0; s < 3 * stage->made_count; s++) {
        const uint32_t *c = stage->made[s / 3].corners;
        struct directed *back = place_of(linker, c[(s + 1) % 3], c[s % 3]);
        if (back->from == MESH_NONE)
            return stage_refuse(stage, "a side of a new triangle has no neighbour");
        back->matched = true;
    }
    for (uint32_t i = 0; i <= linker->mask; i++)
        if (linker->table[i].from != MESH_NONE && linker->table[i].living &&
            !linker->table[i].matched)
            return stage_refuse(stage, "a side beside the cut has no new neighbour");
    return true;
}

// ---- the volume that goes ----

static double six_volumes_of(const struct cut_mesh *mesh, const uint32_t corners[3], vec3 apex) {
    vec3 points[3];
    triangle_points(mesh, corners, points);
    return six_volumes(points, apex);
}

static bool measure(const struct cut_mesh *mesh, struct stage *stage) {
    vec3 apex = stage->blade.vertices[0];
    double sum = 0;
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        if (stage->triangles[k].goes)
            sum += six_volumes_of(mesh, mesh->corners + 3 * (size_t)stage->triangles[k].id, apex);
    for (uint32_t k = 0; k < stage->made_count; k++)
        sum -= six_volumes_of(mesh, stage->made[k].corners, apex);
    stage->removed_mm3 = sum / 6;
    double slack = 1e-6 + 1e-6 * stage->blade.volume;
    return stage->removed_mm3 >= -slack && stage->removed_mm3 <= stage->blade.volume + slack
               ? true
               : stage_refuse(stage,
                              "more volume would go than the blade holds, or less than none");
}

// ---- the mesh changes ----

static void remove_old(struct cut_mesh *mesh, struct stage *stage) {
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        if (stage->triangles[k].goes)
            tissue_remove_triangle(mesh, stage->triangles[k].id);
    for (uint32_t v = 0; v < stage->vertex_count; v++)
        if (!stage->vertices[v].outside)
            tissue_set_spoke(mesh, stage->vertices[v].id, MESH_NONE);
}

static void add_new(struct cut_mesh *mesh, struct stage *stage) {
    struct linker *linker = stage->linker;
    linker->sides.count = 0;
    for (uint32_t i = 0; i < stage->taken.count; i++)
        tissue_set_spoke(mesh, stage->taken.at[i], MESH_NONE);
    for (uint32_t k = 0; k < stage->made_count; k++) {
        const struct new_triangle *t = &stage->made[k];
        uint32_t id = tissue_add_triangle(mesh, t->corners, t->label);
        for (uint32_t i = 0; i < 3; i++) {
            ids_push(&linker->sides, 3 * id + i);
            tissue_set_spoke(mesh, t->corners[i], 3 * id + i);
        }
    }
    for (uint32_t s = 0; s < 3 * stage->made_count; s++) {
        const uint32_t *c = stage->made[s / 3].corners;
        const struct directed *back = place_of(linker, c[(s + 1) % 3], c[s % 3]);
        tissue_join(mesh, linker->sides.at[s],
                    back->living ? back->side : linker->sides.at[back->side]);
    }
}

bool link_triangles(struct cut_mesh *mesh, struct stage *stage) {
    marks_begin(&stage->slots, mesh->triangle_room);
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        if (stage->triangles[k].goes)
            marks_set(&stage->slots, stage->triangles[k].id, 0);
    for (int round = 0;; round++) {
        if (!enter_all(mesh, stage))
            return false;
        if (!stage->linker->doubled.count)
            break;
        if (round == ROUNDS)
            return stage_refuse(stage, "new triangles lie on one another");
        if (!part_doubled(mesh, stage))
            return false;
    }
    return match_sides(stage) && measure(mesh, stage);
}

void link_commit(struct cut_mesh *mesh, struct stage *stage) {
    remove_old(mesh, stage);
    add_new(mesh, stage);
}
