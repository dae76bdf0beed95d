#include "base/check.h"
#include "mesh/columns.h"
#include "generate/maxcut.h"
#include "mesh/solid.h"

#include <stdlib.h>

static const double lattice_mm = 0.25;

vec3 maxcut_sample(const struct mesh *mesh, uint32_t triangle, int sample) {
    vec3 a = mesh_corner(mesh, triangle, sample % 3);
    vec3 b = mesh_corner(mesh, triangle, (sample + 1) % 3);
    if (sample < 3)
        return a;
    if (sample < 6)
        return vec3_lerp(a, b, 0.5);
    return vec3_scale(1.0 / 3, vec3_add(vec3_add(a, b), mesh_corner(mesh, triangle, 2)));
}

static void measure_out(const struct solid *whole, const struct mesh *least,
                        struct maxcut_report *report) {
    uint32_t hint = MESH_NONE;
    for (uint32_t t = 0; t < least->triangle_count; t++)
        for (int i = 0; i < MAXCUT_SAMPLES; i++) {
            double out = solid_distance(whole, maxcut_sample(least, t, i), &hint);
            report->samples++;
            report->out_count += out > MAXCUT_TOLERANCE_MM;
            report->deepest_mm = fmax(report->deepest_mm, out);
        }
}

static void measure_folds(const struct mesh *whole, const struct mesh *least,
                          struct maxcut_report *report) {
    struct folds before = folds_of(whole, NULL), after = folds_of(least, NULL);
    report->folds.crossed = after.crossed > before.crossed ? after.crossed - before.crossed : 0;
    report->folds.creased = after.creased > before.creased ? after.creased - before.creased : 0;
}

static bool is_planned(const struct case_region *plan, vec3 p) {
    for (int i = 0; i < plan->part_count; i++)
        if (convex_contains(&plan->parts[i], p))
            return true;
    return false;
}

// Samples of one column between two heights.
static void measure_span(const struct case_region *plan, const struct solid *least, vec3 at,
                         double end, struct maxcut_report *report) {
    uint32_t hint = MESH_NONE;
    const double share = lattice_mm * lattice_mm * lattice_mm;
    for (at.z = lattice_mm * (ceil(at.z / lattice_mm - 0.5) + 0.5); at.z < end;
         at.z += lattice_mm) {
        if (!is_planned(plan, at))
            continue;
        report->plan_mm3 += share;
        if (solid_distance(least, at, &hint) < 0)
            report->plan_beyond_mm3 += share;
    }
}

static void measure_plan(const struct case_group *group, const struct mesh *whole,
                         const struct solid *least, struct maxcut_report *report) {
    vec3 *points = alloc(whole->vertex_count, sizeof *points);
    for (uint32_t v = 0; v < whole->vertex_count; v++)
        points[v] = mesh_vertex(whole, v);
    struct columns columns;
    columns_init(&columns, whole, points, lattice_mm);
    for (size_t c = 0; c < (size_t)columns.nx * (size_t)columns.ny; c++)
        for (size_t i = columns.first[c]; i + 1 < columns.first[c + 1]; i += 2) {
            vec3 at = {columns.x + lattice_mm * (double)(c % (size_t)columns.nx),
                       columns.y + lattice_mm * (double)(c / (size_t)columns.nx),
                       columns.heights[i]};
            measure_span(&group->lesion.plan, least, at, columns.heights[i + 1], report);
        }
    columns_fini(&columns);
    free(points);
}

enum result maxcut_inspect(const struct case_group *group, struct maxcut_report *out_report,
                           struct error *err) {
    struct mesh whole, least;
    struct solid whole_solid, least_solid;
    CHECK(group->cuttable && group->maxcut);
    *out_report = (struct maxcut_report){0};
    case_group_virtual(group, &whole);
    mesh_copy(&least, &whole);
    for (size_t i = 0; i < 3 * (size_t)least.vertex_count; i++)
        least.positions[i] += group->maxcut[i];
    enum result result = solid_init(&whole_solid, &whole, err);
    enum result second = solid_init(&least_solid, &least, err);
    if (result == RESULT_OK && second == RESULT_OK) {
        out_report->whole_mm3 = mesh_volume(&whole);
        out_report->least_mm3 = mesh_volume(&least);
        measure_out(&whole_solid, &least, out_report);
        measure_folds(&whole, &least, out_report);
        measure_plan(group, &whole, &least_solid, out_report);
    }
    solid_fini(&whole_solid);
    solid_fini(&least_solid);
    mesh_fini(&whole);
    mesh_fini(&least);
    return result == RESULT_OK ? second : result;
}
