#include "import/repair.h"

#include "base/check.h"
#include "import/repair_steps.h"

#include <stdlib.h>
#include <string.h>

#define FLAT_MM 1e-6

void repair_keep(struct mesh *mesh, const bool *kept, bool *flags) {
    uint32_t count = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        if (!kept[t])
            continue;
        memmove(mesh->triangles + 3 * (size_t)count, mesh->triangles + 3 * (size_t)t,
                3 * sizeof *mesh->triangles);
        if (flags)
            flags[count] = flags[t];
        count++;
    }
    mesh->triangle_count = count;
}

static uint32_t remove_repeated_corners(struct mesh *mesh) {
    bool *kept = alloc(mesh->triangle_count, sizeof *kept);
    uint32_t before = mesh->triangle_count;
    for (uint32_t t = 0; t < before; t++) {
        const uint32_t *v = mesh->triangles + 3 * (size_t)t;
        kept[t] = v[0] != v[1] && v[1] != v[2] && v[2] != v[0];
    }
    repair_keep(mesh, kept, NULL);
    free(kept);
    return before - mesh->triangle_count;
}

// ---- what is left -------------------------------------------------------------------------------

static uint32_t count_flat(const struct mesh *mesh) {
    uint32_t count = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0), b = mesh_corner(mesh, t, 1), c = mesh_corner(mesh, t, 2);
        double twice = vec3_length(vec3_cross(vec3_sub(b, a), vec3_sub(c, a)));
        double longest = fmax(vec3_distance(a, b), fmax(vec3_distance(b, c), vec3_distance(c, a)));
        count += !(twice > FLAT_MM * longest);
    }
    return count;
}

static void drop_unused(struct mesh *mesh) {
    uint32_t *place = alloc(mesh->vertex_count, sizeof *place);
    memset(place, 0xff, mesh->vertex_count * sizeof *place);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        place[mesh->triangles[i]] = 0;
    uint32_t count = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        if (place[v] == MESH_NONE)
            continue;
        place[v] = count;
        memmove(mesh->positions + 3 * (size_t)count++, mesh->positions + 3 * (size_t)v,
                3 * sizeof *mesh->positions);
    }
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        mesh->triangles[i] = place[mesh->triangles[i]];
    mesh->vertex_count = count;
    free(place);
}

bool repair_mesh(struct mesh *mesh, const struct repair_settings *settings,
                 struct repair_report *out_report) {
    struct repair_report report = {.vertices_before = mesh->vertex_count,
                                   .triangles_before = mesh->triangle_count};
    report.repeated_corners = remove_repeated_corners(mesh);
    report.before = topology_of(mesh);
    if (report.before.open_edges)
        repair_weld(mesh, settings->weld_mm, &report);
    report.repeated_corners += remove_repeated_corners(mesh);
    repair_duplicates(mesh, &report);
    repair_fins(mesh, &report);
    report.area_mm2 = mesh_area(mesh);
    bool *turned = alloc(mesh->triangle_count, sizeof *turned);
    repair_sheets(mesh, turned, &report);
    repair_islands(mesh, settings->island_share, turned, &report);
    repair_outward(mesh, turned, &report);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        report.turned_triangles += turned[t];
    free(turned);
    drop_unused(mesh);
    report.flat_triangles = count_flat(mesh);
    report.after = topology_of(mesh);
    *out_report = report;
    return mesh->triangle_count > 0;
}
