#include "cut/hollow.h"

#include "cut/ray.h"
#include "cut/spread.h"

static double six_volumes_of(const struct cut_mesh *mesh, const struct ids *triangles) {
    vec3 apex = mesh->points[mesh->corners[3 * (size_t)triangles->at[0]]], points[3];
    double sum = 0;
    for (uint32_t i = 0; i < triangles->count; i++) {
        triangle_points(mesh, mesh->corners + 3 * (size_t)triangles->at[i], points);
        sum += six_volumes(points, apex);
    }
    return sum;
}

void hollow_append(const struct cut_mesh *mesh, struct stamped_set *seen, struct ids *triangles) {
    struct ids part = {0};
    uint32_t around = triangles->count;
    stamped_set_begin(seen, mesh->triangle_room);
    for (uint32_t i = 0; i < around; i++)
        stamped_set_put(seen, triangles->at[i], 0);
    for (uint32_t t = 0; t < mesh->triangle_bound; t++) {
        if (!cut_mesh_triangle_alive(mesh, t) || stamped_set_has(seen, t))
            continue;
        part.count = 0;
        spread(mesh, NULL, seen, &part, t);
        vec3 point = mesh->points[mesh->corners[3 * (size_t)t]];
        if (six_volumes_of(mesh, &part) < 0 &&
            ray_winding_of(mesh, triangles->at, around, point) == 1)
            for (uint32_t i = 0; i < part.count; i++)
                ids_push(triangles, part.at[i]);
    }
    ids_fini(&part);
}
