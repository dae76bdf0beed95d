#include "cut/hollow.h"

#include "cut/ray.h"

static double six_volumes_of_part(const struct cut_mesh *mesh, const struct ids *triangles,
                                  uint32_t first) {
    vec3 apex = mesh->points[mesh->corners[3 * (size_t)triangles->at[first]]], points[3];
    double sum = 0;
    for (uint32_t i = first; i < triangles->count; i++) {
        triangle_points(mesh, mesh->corners + 3 * (size_t)triangles->at[i], points);
        sum += six_volumes(points, apex);
    }
    return sum;
}

// ---- a closed part ----

enum { CLOSED, OPEN };

// Appends the triangle and all that hang together with it. Where some of them are original surface
// of one part, none is appended: that looks outwards.
static void append_part(const struct cut_mesh *mesh, struct stamped_set *seen, struct ids *list,
                        uint32_t triangle) {
    uint32_t first = list->count;
    bool closed = true;
    stamped_set_put(seen, triangle, CLOSED);
    ids_push(list, triangle);
    for (uint32_t next = first; next < list->count && closed; next++)
        for (size_t i = 0; i < 3; i++) {
            uint32_t beside = mesh->twins[3 * (size_t)list->at[next] + i] / 3;
            bool known = stamped_set_has(seen, beside);
            closed &= known ? stamped_set_get(seen, beside) == CLOSED
                            : mesh->labels[beside] || mesh->parted;
            if (known)
                continue;
            stamped_set_put(seen, beside, CLOSED);
            ids_push(list, beside);
        }
    if (closed)
        return;
    for (uint32_t i = first; i < list->count; i++)
        stamped_set_put(seen, list->at[i], OPEN);
    list->count = first;
}

// ---- all ----

void hollow_find(const struct cut_mesh *mesh, struct stamped_set *seen, struct cavities *out) {
    *out = (struct cavities){0};
    stamped_set_begin(seen, mesh->triangle_room);
    for (uint32_t t = 0; t < mesh->triangle_bound; t++) {
        uint32_t first = out->triangles.count;
        if ((!mesh->labels[t] && !mesh->parted) || stamped_set_has(seen, t) ||
            !cut_mesh_triangle_alive(mesh, t))
            continue;
        append_part(mesh, seen, &out->triangles, t);
        if (out->triangles.count > first && six_volumes_of_part(mesh, &out->triangles, first) < 0)
            ids_push(&out->ends, out->triangles.count);
        else
            out->triangles.count = first;
    }
}

void cavities_fini(struct cavities *cavities) {
    ids_fini(&cavities->triangles);
    ids_fini(&cavities->ends);
    *cavities = (struct cavities){0};
}

void hollow_append(const struct cut_mesh *mesh, const struct cavities *cavities,
                   struct stamped_set *seen, struct ids *triangles) {
    uint32_t around = triangles->count;
    stamped_set_begin(seen, mesh->triangle_room);
    for (uint32_t i = 0; i < around; i++)
        stamped_set_put(seen, triangles->at[i], 0);
    for (uint32_t k = 0, begin = 0, end; k < cavities->ends.count; k++, begin = end) {
        uint32_t first = cavities->triangles.at[begin];
        end = cavities->ends.at[k];
        if (!cut_mesh_triangle_alive(mesh, first) || stamped_set_has(seen, first))
            continue;
        vec3 point = mesh->points[mesh->corners[3 * (size_t)first]];
        if (ray_winding_of(mesh, triangles->at, around, point) == 1)
            for (uint32_t i = begin; i < end; i++)
                ids_push(triangles, cavities->triangles.at[i]);
    }
}
