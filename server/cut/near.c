#include "cut/stage.h"

#define MARGIN_MM 1e-4 // more than blades grow

static uint64_t take_values(const struct convex *blade, vec3 p, double *out_values) {
    uint64_t outside = 0;
    for (int i = 0; i < blade->plane_count; i++) {
        out_values[i] = vec3_dot(blade->planes[i].normal, p) - blade->planes[i].offset;
        outside |= (uint64_t)(out_values[i] > 0) << i;
    }
    return outside;
}

static uint32_t near_vertex(const struct cut_mesh *mesh, struct stage *stage, uint32_t id) {
    if (stamped_set_has(&stage->slots, id))
        return stamped_set_get(&stage->slots, id);
    uint32_t slot = stage->vertex_count++, planes = (uint32_t)stage->blade.plane_count;
    stage->vertices = array_grow(stage->vertices, &stage->vertex_room, stage->vertex_count,
                                 sizeof *stage->vertices);
    stage->values = array_grow(stage->values, &stage->value_room, planes * stage->vertex_count,
                               sizeof *stage->values);
    uint64_t outside =
        take_values(&stage->blade, mesh->points[id], stage->values + (size_t)planes * slot);
    stage->vertices[slot] = (struct near_vertex){id, outside};
    stamped_set_put(&stage->slots, id, slot);
    return slot;
}

static bool boxes_meet(const struct cut_mesh *mesh, uint32_t triangle, const struct box *box) {
    vec3 p[3];
    triangle_points(mesh, mesh->corners + 3 * (size_t)triangle, p);
    return !((p[0].x < box->min.x && p[1].x < box->min.x && p[2].x < box->min.x) ||
             (p[0].y < box->min.y && p[1].y < box->min.y && p[2].y < box->min.y) ||
             (p[0].z < box->min.z && p[1].z < box->min.z && p[2].z < box->min.z) ||
             (p[0].x > box->max.x && p[1].x > box->max.x && p[2].x > box->max.x) ||
             (p[0].y > box->max.y && p[1].y > box->max.y && p[2].y > box->max.y) ||
             (p[0].z > box->max.z && p[1].z > box->max.z && p[2].z > box->max.z));
}

static bool is_near(const struct cut_mesh *mesh, struct stage *stage, uint32_t id) {
    const uint32_t *corners = mesh->corners + 3 * (size_t)id;
    uint64_t outside = UINT64_MAX;
    for (int i = 0; i < 3 && outside; i++) {
        uint32_t slot = near_vertex(mesh, stage, corners[i]);
        outside &= stage->vertices[slot].outside;
    }
    return !outside;
}

static void keep_near(const struct cut_mesh *mesh, struct stage *stage, const struct box *box) {
    struct ids *triangles = &stage->candidates;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < triangles->count; i++)
        if (boxes_meet(mesh, triangles->at[i], box) && is_near(mesh, stage, triangles->at[i]))
            triangles->at[kept++] = triangles->at[i];
    triangles->count = kept;
}

static void add_near_triangle(const struct cut_mesh *mesh, struct stage *stage, uint32_t id) {
    struct near_triangle near = {.id = id};
    for (int i = 0; i < 3; i++)
        near.corners[i] = near_vertex(mesh, stage, mesh->corners[3 * (size_t)id + (size_t)i]);
    stage->triangles = array_grow(stage->triangles, &stage->triangle_room,
                                  stage->triangle_count + 1, sizeof *stage->triangles);
    stage->triangles[stage->triangle_count++] = near;
}

// What the cut has touched is not in the grid as it is now: until the cut is made, it is looked
// through as a whole.
void near_collect(const struct cut_mesh *mesh, struct box box, const struct convex *blade,
                  struct stamped_set *seen, struct ids *out) {
    const struct undo *undo = &mesh->scratch->undo;
    struct plane planes[CONVEX_PLANES_MAX];
    int count = blade ? blade->plane_count : 0;
    for (int i = 0; i < count; i++)
        planes[i] = (struct plane){blade->planes[i].normal, blade->planes[i].offset + MARGIN_MM};
    stamped_set_begin(seen, mesh->triangle_room);
    out->count = 0;
    for (uint32_t i = 0; i < undo->triangle_count; i++) {
        stamped_set_put(seen, undo->triangles[i].id, 0);
        if (cut_mesh_triangle_alive(mesh, undo->triangles[i].id))
            ids_push(out, undo->triangles[i].id);
    }
    grid_collect(&mesh->grid, box, planes, count, seen, out);
}

// The margin takes in both triangles of each edge that has a crossing.
void near_gather(struct cut_mesh *mesh, struct stage *stage) {
    vec3 margin = {MARGIN_MM, MARGIN_MM, MARGIN_MM};
    struct box box = {vec3_sub(stage->blade.box.min, margin),
                      vec3_add(stage->blade.box.max, margin)};
    near_collect(mesh, box, &stage->blade, &stage->slots, &stage->candidates);
    stamped_set_begin(&stage->slots, mesh->vertex_room);
    stage->vertex_count = stage->triangle_count = 0;
    keep_near(mesh, stage, &box);
    ids_sort(&stage->candidates); // the grid's order depends on cuts that were refused
    for (uint32_t i = 0; i < stage->candidates.count; i++)
        add_near_triangle(mesh, stage, stage->candidates.at[i]);
}
