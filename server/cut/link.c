#include "cut/edit.h"
#include "cut/stage.h"

// ---- each side finds its other side ----

static bool goes(const struct stage *stage, uint32_t triangle) {
    return stamped_set_has(&stage->slots, triangle);
}

// *out_count: sides of triangles that stay.
static bool enter_border(const struct cut_mesh *mesh, struct stage *stage, uint32_t *out_count) {
    *out_count = 0;
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        for (uint32_t i = 0; stage->triangles[k].goes && i < 3; i++) {
            uint32_t twin = mesh->twins[3 * stage->triangles[k].id + i];
            struct side_entry entry = {.from = mesh->corners[twin],
                                       .to = side_end(mesh, twin),
                                       .side = twin,
                                       .living = true};
            if (goes(stage, twin / 3))
                continue;
            if (!sides_enter(&stage->sides, entry))
                return stage_refuse(stage, "two neighbours of the cut run alike");
            ++*out_count;
        }
    return true;
}

static bool enter_all(const struct cut_mesh *mesh, struct stage *stage, uint32_t going,
                      uint32_t *out_border) {
    sides_clear(&stage->sides, 3 * (stage->made_count + going));
    if (!enter_border(mesh, stage, out_border))
        return false;
    for (uint32_t s = 0; s < 3 * stage->made_count; s++) {
        const uint32_t *c = stage->made[s / 3].corners;
        if (!sides_enter(&stage->sides,
                         (struct side_entry){.from = c[s % 3], .to = c[(s + 1) % 3], .side = s}))
            return stage_refuse(stage, "two new triangles run alike");
    }
    return true;
}

static struct side_entry *back_of(const struct stage *stage, uint32_t side) {
    const uint32_t *c = stage->made[side / 3].corners;
    return sides_place(&stage->sides, c[(side + 1) % 3], c[side % 3]);
}

// No two sides have the same back, so it is enough to count those that stay.
static bool match_sides(struct stage *stage, uint32_t border) {
    stage->backs =
        array_grow(stage->backs, &stage->back_room, 3 * stage->made_count, sizeof *stage->backs);
    for (uint32_t s = 0; s < 3 * stage->made_count; s++) {
        const struct side_entry *back = back_of(stage, s);
        if (!sides_is_here(back))
            return stage_refuse(stage, "a side of a new triangle has no neighbour");
        border -= back->living;
        stage->backs[s] = (struct back_side){back->side, back->living};
    }
    return border == 0 ? true : stage_refuse(stage, "a side beside the cut has no new neighbour");
}

// ---- the volume that goes ----

#define SLACK_MM3 1e-3 // by which a blade may have grown

static double six_volumes_under(const struct cut_mesh *mesh, const uint32_t corners[3], vec3 apex) {
    vec3 points[3];
    triangle_points(mesh, corners, points);
    return six_volumes(points, apex);
}

static bool measure_link(const struct cut_mesh *mesh, struct stage *stage) {
    vec3 apex = stage->blade.vertices[0];
    double sum = 0;
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        if (stage->triangles[k].goes)
            sum +=
                six_volumes_under(mesh, mesh->corners + 3 * (size_t)stage->triangles[k].id, apex);
    for (uint32_t k = 0; k < stage->made_count; k++)
        sum -= six_volumes_under(mesh, stage->made[k].corners, apex);
    stage->removed_mm3 = sum / 6;
    return stage->removed_mm3 >= -SLACK_MM3 && stage->removed_mm3 <= stage->blade.volume + SLACK_MM3
               ? true
               : stage_refuse(stage,
                              "more volume would go than the blade holds, or less than none");
}

// ---- the mesh changes ----

// Where none of the old surface goes, the new surface is a cavity.
static void remove_old(struct cut_mesh *mesh, struct stage *stage) {
    uint32_t living = mesh->living;
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        if (stage->triangles[k].goes)
            edit_remove_triangle(mesh, stage->triangles[k].id);
    mesh->hollow |= mesh->living == living;
    for (uint32_t v = 0; v < stage->vertex_count; v++)
        if (!stage->vertices[v].outside)
            edit_set_vertex_side(mesh, stage->vertices[v].id, MESH_NONE);
}

static uint32_t side_of_made(const struct stage *stage, uint32_t side) {
    return 3 * stage->made_ids.at[side / 3] + side % 3;
}

static void add_new(struct cut_mesh *mesh, struct stage *stage) {
    stage->made_ids.count = 0;
    for (uint32_t i = 0; i < stage->taken.count; i++)
        edit_set_vertex_side(mesh, stage->taken.at[i], MESH_NONE);
    for (uint32_t k = 0; k < stage->made_count; k++) {
        const struct new_triangle *t = &stage->made[k];
        uint32_t id = edit_add_triangle(mesh, t->corners, t->label);
        ids_push(&stage->made_ids, id);
        for (uint32_t i = 0; i < 3; i++)
            edit_set_vertex_side(mesh, t->corners[i], 3 * id + i);
    }
    for (uint32_t s = 0; s < 3 * stage->made_count; s++) {
        struct back_side back = stage->backs[s];
        if (back.living || back.side > s)
            edit_join(mesh, side_of_made(stage, s),
                      back.living ? back.side : side_of_made(stage, back.side));
    }
}

bool link_triangles(struct cut_mesh *mesh, struct stage *stage) {
    uint32_t going = 0, border;
    stamped_set_begin(&stage->slots, mesh->triangle_room);
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        if (stage->triangles[k].goes) {
            stamped_set_put(&stage->slots, stage->triangles[k].id, 0);
            going++;
        }
    return enter_all(mesh, stage, going, &border) && match_sides(stage, border) &&
           measure_link(mesh, stage);
}

void link_commit(struct cut_mesh *mesh, struct stage *stage) {
    remove_old(mesh, stage);
    add_new(mesh, stage);
}
