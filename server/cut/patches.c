#include "cut/change.h"
#include "cut/flood.h"
#include "cut/spread.h"

// ---- one patch ----

static bool is_new_surface(const struct cut_mesh *mesh, uint32_t triangle) {
    return stamped_set_has(&mesh->scratch->undo.triangles_seen, triangle) &&
           cut_mesh_triangle_alive(mesh, triangle) && mesh->labels[triangle] == mesh->number;
}

static struct cut_patch measure_patch(const struct cut_mesh *mesh, const uint32_t *triangles,
                                      uint32_t count) {
    struct cut_patch patch = {0};
    vec3 origin = mesh->points[mesh->corners[3 * (size_t)triangles[0]]], moment = {0}, p[3];
    for (uint32_t i = 0; i < count; i++) {
        triangle_points(mesh, mesh->corners + 3 * (size_t)triangles[i], p);
        vec3 normal = vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0]));
        double area = vec3_length(normal) / 2;
        for (int k = 0; k < 3; k++)
            moment = vec3_add_scaled(moment, area / 3, vec3_sub(p[k], origin));
        patch.area += area;
    }
    patch.centroid = patch.area > 0 ? vec3_add_scaled(origin, 1 / patch.area, moment) : origin;
    for (uint32_t i = 0; i < count; i++) {
        triangle_points(mesh, mesh->corners + 3 * (size_t)triangles[i], p);
        for (int k = 0; k < 3; k++)
            patch.extent = higher(patch.extent, vec3_distance(p[k], patch.centroid));
    }
    return patch;
}

// ---- all ----

void change_measure_patches(struct cut_mesh *mesh, struct cut_change *change) {
    struct stamped_set *seen = &mesh->scratch->flood->owner;
    struct ids *list = &mesh->scratch->flood->list;
    list->count = 0;
    stamped_set_begin(seen, mesh->triangle_room);
    for (uint32_t i = 0; i < change->made_count; i++) {
        uint32_t first = list->count, triangle = change->made[i];
        if (stamped_set_has(seen, triangle) || !is_new_surface(mesh, triangle))
            continue;
        spread(mesh, is_new_surface, seen, list, triangle);
        change->patches =
            alloc_resize(change->patches, (size_t)change->patch_count + 1, sizeof *change->patches);
        change->patches[change->patch_count++] =
            measure_patch(mesh, list->at + first, list->count - first);
    }
}
