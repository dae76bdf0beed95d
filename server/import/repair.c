#include "import/repair.h"

#include "base/check.h"
#include "import/repair_steps.h"
#include "mesh/edges.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FLAT_MM 1e-6

void repair_at(struct repair_report *report, enum repair_kind kind, vec3 p) {
    struct repair_place *place = &report->places[kind];
    struct box *box = &place->box;
    if (!place->somewhere)
        *place = (struct repair_place){true, {p, p}};
    box->min = (vec3){fmin(box->min.x, p.x), fmin(box->min.y, p.y), fmin(box->min.z, p.z)};
    box->max = (vec3){fmax(box->max.x, p.x), fmax(box->max.y, p.y), fmax(box->max.z, p.z)};
}

void repair_at_triangle(struct repair_report *report, enum repair_kind kind,
                        const struct mesh *mesh, uint32_t triangle) {
    for (int i = 0; i < 3; i++)
        repair_at(report, kind, mesh_corner(mesh, triangle, i));
}

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

static uint32_t remove_repeated_corners(struct mesh *mesh, struct repair_report *report) {
    bool *kept = alloc(mesh->triangle_count, sizeof *kept);
    uint32_t before = mesh->triangle_count;
    for (uint32_t t = 0; t < before; t++) {
        const uint32_t *v = mesh->triangles + 3 * (size_t)t;
        kept[t] = v[0] != v[1] && v[1] != v[2] && v[2] != v[0];
        if (!kept[t])
            repair_at_triangle(report, REPAIR_REPEATED, mesh, t);
    }
    repair_keep(mesh, kept, NULL);
    free(kept);
    return before - mesh->triangle_count;
}

// ---- what is left -------------------------------------------------------------------------------

static uint32_t count_flat(const struct mesh *mesh, struct repair_report *report) {
    uint32_t count = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0), b = mesh_corner(mesh, t, 1), c = mesh_corner(mesh, t, 2);
        double twice = vec3_length(vec3_cross(vec3_sub(b, a), vec3_sub(c, a)));
        double longest = fmax(vec3_distance(a, b), fmax(vec3_distance(b, c), vec3_distance(c, a)));
        if (!(twice > FLAT_MM * longest)) {
            repair_at_triangle(report, REPAIR_FLAT, mesh, t);
            count++;
        }
    }
    return count;
}

static void place_edges(const struct mesh *mesh, struct repair_report *report) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    struct triangle_side *sides = edges_sorted(mesh);
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        if (end - i == 2)
            continue;
        enum repair_kind kind = end - i == 1 ? REPAIR_OPEN : REPAIR_CROWDED;
        repair_at(report, kind, mesh_vertex(mesh, sides[i].low));
        repair_at(report, kind, mesh_vertex(mesh, sides[i].high));
    }
    free(sides);
}

void repair_look(const struct mesh *mesh, struct repair_report *report) {
    for (int kind = REPAIR_VOID; kind <= REPAIR_CROWDED; kind++)
        report->places[kind].somewhere = false;
    repair_voids(mesh, report);
    report->flat_triangles = count_flat(mesh, report);
    place_edges(mesh, report);
    report->after = topology_of(mesh);
}

bool repair_mesh(struct mesh *mesh, const struct repair_settings *settings,
                 struct repair_report *out_report) {
    struct repair_report report = {.vertices_before = mesh->vertex_count,
                                   .triangles_before = mesh->triangle_count};
    report.repeated_corners = remove_repeated_corners(mesh, &report);
    report.before = topology_of(mesh);
    if (report.before.open_edges)
        repair_weld(mesh, settings->weld_mm, &report);
    report.repeated_corners += remove_repeated_corners(mesh, &report);
    repair_duplicates(mesh, &report);
    repair_fins(mesh, &report);
    report.area_mm2 = mesh_area(mesh);
    bool *turned = alloc(mesh->triangle_count, sizeof *turned);
    repair_sheets(mesh, turned, &report);
    repair_islands(mesh, settings->island_share, turned, &report);
    repair_outward(mesh, turned);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        if (turned[t]) {
            repair_at_triangle(&report, REPAIR_TURNED, mesh, t);
            report.turned_triangles++;
        }
    free(turned);
    mesh_drop_unused(mesh);
    repair_look(mesh, &report);
    *out_report = report;
    return mesh->triangle_count > 0;
}
