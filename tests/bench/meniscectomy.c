#include "meniscectomy.h"

#include "base/check.h"
#include "base/clock.h"
#include "case/arc.h"
#include "mesh/query.h"

#include <stdlib.h>
#include <string.h>

// The first row of bites and the second, behind it.
#define FIRST_ROW 8
static const double row_depth_mm[] = {2.2, 4.2}; // of the jaw's tip, from the inner margin
static const double bite_step_mm = 2.3, below_mm = 0.2;
static const double middle_along = 0.58; // of the body

// ---- the bites ----

// The jaw comes from the middle of the C, its lower half below the tissue.
static pose tip_at(const struct arc *arc, double along, double depth_mm) {
    double inward = arc_width(arc, along) - depth_mm, lower, upper;
    arc_heights(arc, along, inward, &lower, &upper);
    vec3 y = arc_up(arc), z = arc_outward(arc, along), x = vec3_cross(y, z);
    mat3 axes = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
    struct arc_place place = {along, inward, lower - below_mm};
    return (pose){quat_from_mat3(axes), arc_point(arc, place)};
}

static struct blade_move bite_at(const struct arc *arc, int index) {
    int row = index >= FIRST_ROW, count = row ? BITE_COUNT - FIRST_ROW : FIRST_ROW;
    double radius = arc_radius(arc, middle_along) - arc_width(arc, middle_along);
    double off_mm = (index - row * FIRST_ROW - (count - 1) / 2.0) * bite_step_mm;
    double along = middle_along + off_mm / (radius * fabs(arc_angle(arc)));
    pose tip = tip_at(arc, along, row_depth_mm[row]);
    return (struct blade_move){BLADE_PUNCH, {tip, tip}, {1, 0}};
}

// ---- a section ----

#define BESIDE_MM 3.0 // the section goes so far beyond the margins, above and below

static enum result section_of(const struct arc *arc, struct convex *out, struct error *err) {
    vec3 up = arc_up(arc), out_ = arc_outward(arc, middle_along), along = vec3_cross(up, out_);
    double width = arc_width(arc, middle_along), lower, upper;
    arc_heights(arc, middle_along, 0.3 * width, &lower, &upper);
    struct arc_place place = {middle_along, 0, lower};
    vec3 at = arc_point(arc, place);
    const struct {
        vec3 normal;
        double beyond;
    } sides[6] = {{along, SECTION_MM / 2},
                  {vec3_scale(-1, along), SECTION_MM / 2},
                  {out_, BESIDE_MM},
                  {vec3_scale(-1, out_), width + BESIDE_MM},
                  {up, 20},
                  {vec3_scale(-1, up), 20}};
    struct plane planes[6];
    for (int i = 0; i < 6; i++)
        planes[i] =
            (struct plane){sides[i].normal, vec3_dot(sides[i].normal, at) + sides[i].beyond};
    return convex_create(planes, 6, out, err);
}

// ---- the tissue ----

static enum result find_group(struct meniscectomy *m, const struct knee_case *knee,
                              struct error *err) {
    for (int i = 0; i < knee->group_count; i++)
        if (strcmp(knee->groups[i].name, "meniscus_medial") == 0)
            m->group = &knee->groups[i];
    if (!m->group || !m->group->cuttable || !m->group->maxcut)
        return fail(err, RESULT_MISSING, "case %s: no medial meniscus that can be cut", knee->name);
    return RESULT_OK;
}

enum result meniscectomy_init(struct meniscectomy *m, const struct knee_case *knee,
                              struct error *err) {
    struct arc *arc;
    *m = (struct meniscectomy){0};
    enum result result = find_group(m, knee, err);
    if (result != RESULT_OK)
        return result;
    case_group_virtual(m->group, &m->whole);
    result = arc_create(&m->whole, knee->joint.T_tibia_joint, &arc, err);
    if (result == RESULT_OK) {
        for (int i = 0; i < BITE_COUNT; i++)
            m->bites[i] = bite_at(arc, i);
        result = section_of(arc, &m->section, err);
        arc_destroy(&arc);
    }
    if (result == RESULT_OK) {
        m->surface = match_surface_create(&m->group->mesh, m->group->warp, m->group->maxcut);
        result = cut_mesh_create(&m->whole, &m->cut, err);
    }
    if (result == RESULT_OK)
        meniscectomy_restart(m);
    else
        meniscectomy_fini(m);
    return result;
}

void meniscectomy_fini(struct meniscectomy *m) {
    match_destroy(&m->match);
    bisection_destroy(&m->bisection);
    match_surface_destroy(&m->surface);
    cut_mesh_destroy(&m->cut);
    mesh_fini(&m->whole);
}

void meniscectomy_restart(struct meniscectomy *m) {
    match_destroy(&m->match);
    bisection_destroy(&m->bisection);
    cut_mesh_destroy(&m->cut);
    m->match = match_create(m->surface);
    m->bisection = bisection_create(&m->group->mesh, m->group->warp, m->group->maxcut);
    CHECK(cut_mesh_create(&m->whole, &m->cut, NULL) == RESULT_OK);
}

// ---- one bite ----

static double ms_since(int64_t begin_ns) {
    return (double)(clock_now_ns() - begin_ns) / (double)NS_PER_MS;
}

// Both ways, each on blends of its own.
static void match(struct meniscectomy *m, const struct cut_change *change,
                  struct bite_report *out_report) {
    struct brush *brushes = alloc((size_t)change->patch_count, sizeof *brushes);
    for (int i = 0; i < change->patch_count; i++)
        brushes[i] = (struct brush){change->patches[i].centroid, change->patches[i].extent};
    struct match_report reports[WORK_COUNT];
    double target = change->volume_mm3;
    int64_t begin_ns = clock_now_ns();
    match_to_volume(m->match, brushes, change->patch_count, target, &reports[WORK_MATCH]);
    out_report->ms[WORK_MATCH] = ms_since(begin_ns);
    begin_ns = clock_now_ns();
    bisection_match(m->bisection, brushes, change->patch_count, target, ALGORITHM_1_MM3,
                    &reports[WORK_BISECTION]);
    out_report->ms[WORK_BISECTION] = ms_since(begin_ns);
    for (int work = WORK_MATCH; work < WORK_COUNT; work++)
        out_report->steps[work] = reports[work].steps;
    free(brushes);
}

enum result meniscectomy_bite(struct meniscectomy *m, int index, struct bite_report *out_report,
                              struct error *err) {
    struct convex *parts = alloc(CUT_PARTS_MAX, sizeof *parts);
    struct cut_change change = {0};
    int count = blade_parts(instruments_usual(), &m->bites[index], true, parts, err);
    int64_t begin_ns = clock_now_ns();
    enum cut_outcome outcome =
        count < 0 ? CUT_REFUSED : cut_apply(m->cut, parts, count, &change, err);
    *out_report = (struct bite_report){.ms[WORK_CUT] = ms_since(begin_ns)};
    free(parts);
    if (outcome == CUT_REFUSED)
        return fail_in(err, RESULT_REFUSED, "bite %d: ", index + 1);
    if (outcome == CUT_CHANGED)
        match(m, &change, out_report);
    out_report->removed_mm3 = change.removed_mm3;
    out_report->cut_mm3 = cut_mesh_volume(m->cut);
    out_report->warped_mm3 = match_volume(m->match);
    cut_change_fini(&change);
    return RESULT_OK;
}

// ---- equal in volume, but where? ----

void meniscectomy_warped(const struct meniscectomy *m, struct mesh *out_mesh) {
    mesh_copy(out_mesh, &m->whole);
    for (uint32_t v = 0; v < out_mesh->vertex_count; v++)
        mesh_set_vertex(out_mesh, v, match_vertex(m->match, v));
}

enum result meniscectomy_gap(const struct meniscectomy *m, double *out_mean_mm,
                             double *out_largest_mm, struct error *err) {
    struct mesh warped;
    struct query *query;
    meniscectomy_warped(m, &warped);
    enum result result = query_create(&warped, &query, err);
    double sum = 0;
    int count = 0;
    *out_largest_mm = 0;
    for (uint32_t t = 0; result == RESULT_OK && t < cut_mesh_triangle_bound(m->cut); t++) {
        if (!cut_mesh_triangle_alive(m->cut, t) || !cut_mesh_label(m->cut, t))
            continue;
        for (int i = 0; i < 3; i++, count++) {
            struct closest closest;
            vec3 p = cut_mesh_vertex(m->cut, cut_mesh_triangle(m->cut, t)[i]);
            query_closest(query, p, INFINITY, MESH_NONE, &closest);
            sum += closest.distance;
            *out_largest_mm = fmax(*out_largest_mm, closest.distance);
        }
    }
    *out_mean_mm = count ? sum / count : 0;
    if (result == RESULT_OK)
        query_destroy(&query);
    mesh_fini(&warped);
    return result;
}
