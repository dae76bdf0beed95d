#include "check/inspect.h"

#include "base/check.h"
#include "check/anatomy.h"
#include "generate/maxcut.h"
#include "import/import.h"
#include "mesh/query.h"
#include "mesh/topology.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define DISPLACEMENT_MAX_MM 30
#define PORTAL_OFF_SKIN_MAX_MM 5
#define OUT_MAX_MM 0.5
#define PLAN_BEYOND_MAX 0.1
#define WAY_PARTS 4

void inspection_note(struct inspection *inspection, enum finding_level level, const char *where,
                     const char *format, ...) {
    inspection->faults += level == FINDING_FAULT;
    inspection->warnings += level == FINDING_WARNING;
    if (inspection->count == CHECK_FINDINGS_MAX) {
        inspection->left_out++;
        return;
    }
    struct check_finding *finding = &inspection->findings[inspection->count++];
    finding->level = level;
    snprintf(finding->where, sizeof finding->where, "%s", where);
    va_list args;
    va_start(args, format);
    vsnprintf(finding->text, sizeof finding->text, format, args);
    va_end(args);
}

double inspect_worst_wear(const struct case_group *group) {
    float worst = 0;
    for (uint32_t v = 0; group->wear && v < group->mesh.vertex_count; v++)
        worst = fmaxf(worst, group->wear[v]);
    return (double)worst;
}

double inspect_largest(const struct case_group *group, const float *displacement) {
    double largest = 0;
    for (size_t v = 0; displacement && v < group->mesh.vertex_count; v++) {
        const float *d = displacement + 3 * v;
        largest = fmax(largest, vec3_length((vec3){(double)d[0], (double)d[1], (double)d[2]}));
    }
    return largest;
}

vec3 inspect_joint_centre(const struct knee_case *knee) {
    return knee->joint.T_femur_joint.translation;
}

// ---- the medial plateau -------------------------------------------------------------------------

// The height z over (x, y) of a triangle seen from above; false where (x, y) is beside it.
static bool height_over(const vec3 p[3], double x, double y, double *out_z) {
    double area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (p[1].y - p[0].y);
    if (area == 0)
        return false;
    double b = ((x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (y - p[0].y)) / area;
    double c = ((p[1].x - p[0].x) * (y - p[0].y) - (x - p[0].x) * (p[1].y - p[0].y)) / area;
    *out_z = p[0].z + b * (p[1].z - p[0].z) + c * (p[2].z - p[0].z);
    return b >= 0 && c >= 0 && b + c <= 1;
}

// Box of the mesh in the joint's frame, from the height `above` on.
static struct box box_in_joint(const struct mesh *mesh, pose T_mesh_joint, double above) {
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = pose_apply_inverse(T_mesh_joint, mesh_vertex(mesh, v));
        if (p.z >= above)
            box_include(&box, p);
    }
    return box;
}

static double medial_sign(const struct knee_case *knee) {
    return knee->joint.side == SIDE_LEFT ? 1 : -1;
}

bool inspect_medial_plateau(struct knee_case *knee, vec3 *out_point) {
    const struct case_group *tibia = case_group(knee, "tibia");
    CHECK(tibia);
    pose T_tibia_joint = knee->joint.T_tibia_joint;
    struct box box = box_in_joint(&tibia->mesh, T_tibia_joint, -INFINITY);
    box = box_in_joint(&tibia->mesh, T_tibia_joint, box.max.z - 15);
    vec3 top = {.x = (box.min.x + box.max.x) / 2 + medial_sign(knee) * (box.max.x - box.min.x) / 4,
                .y = (box.min.y + box.max.y) / 2,
                .z = -INFINITY};
    for (uint32_t t = 0; t < tibia->mesh.triangle_count; t++) {
        vec3 corners[3];
        double z;
        for (int i = 0; i < 3; i++)
            corners[i] = pose_apply_inverse(T_tibia_joint, mesh_corner(&tibia->mesh, t, i));
        if (height_over(corners, top.x, top.y, &z))
            top.z = fmax(top.z, z);
    }
    *out_point = pose_apply(T_tibia_joint, top);
    return isfinite(top.z);
}

// ---- findings -----------------------------------------------------------------------------------

static void inspect_surface(const struct case_group *group, struct inspection *out) {
    struct topology t = topology_of(&group->mesh);
    if (!t.closed)
        inspection_note(out, FINDING_WARNING, group->name, "open: %u edges with one triangle",
                        t.open_edges);
    if (!t.manifold)
        inspection_note(out, FINDING_WARNING, group->name, "not manifold: %u edges, %u vertices",
                        t.non_manifold_edges, t.non_manifold_vertices);
    if (!t.oriented)
        inspection_note(out, FINDING_WARNING, group->name, "triangles disagree along %u edges",
                        t.flipped_edges);
    if (t.unused_vertices)
        inspection_note(out, FINDING_WARNING, group->name, "%u vertices in no triangle",
                        t.unused_vertices);
    if (t.closed && t.oriented && mesh_volume(&group->mesh) <= 0)
        inspection_note(out, FINDING_FAULT, group->name, "inside out: its volume is %.0f mm3",
                        mesh_volume(&group->mesh));
}

static void inspect_displacements(const struct case_group *group, struct inspection *out) {
    double warp = inspect_largest(group, group->warp);
    double maxcut = inspect_largest(group, group->maxcut);
    if (warp >= DISPLACEMENT_MAX_MM)
        inspection_note(out, FINDING_FAULT, group->name,
                        "warp moves a vertex by %.1f mm, %d or more", warp, DISPLACEMENT_MAX_MM);
    if (maxcut >= DISPLACEMENT_MAX_MM)
        inspection_note(out, FINDING_FAULT, group->name,
                        "maxcut moves a vertex by %.1f mm, %d or more", maxcut,
                        DISPLACEMENT_MAX_MM);
}

static void inspect_budget(const struct case_group *group, const struct maxcut_report *report,
                           struct inspection *out) {
    const char *where = group->name;
    double budget = report->whole_mm3 - report->least_mm3, beyond = report->plan_beyond_mm3;
    if (group->lesion.plan.part_count == 0) {
        inspection_note(out, FINDING_NOTE, where, "cut budget %.0f of %.0f mm3", budget,
                        report->whole_mm3);
        return;
    }
    inspection_note(out, FINDING_NOTE, where,
                    "cut budget %.0f of %.0f mm3; planned %.0f mm3, %.0f within it", budget,
                    report->whole_mm3, report->plan_mm3, report->plan_mm3 - beyond);
    if (beyond > PLAN_BEYOND_MAX * report->plan_mm3)
        inspection_note(out, FINDING_WARNING, where,
                        "%.0f mm3 of the plan lie within tissue that must stay", beyond);
}

static uint32_t more(uint32_t after, uint32_t before) {
    return after > before ? after - before : 0;
}

// A cut in a part of the tissue leaves the touched surface between S' and S'_max, and so does
// easing. The match ends creases of its own; what crosses has no room.
static void inspect_group_way(const struct case_group *group, struct inspection *out) {
    struct mesh whole, between;
    struct folds worst = {0};
    int at = 0;
    case_group_virtual(group, &whole);
    mesh_copy(&between, &whole);
    struct folds before = folds_of(&whole, NULL);
    for (int part = 1; part < WAY_PARTS; part++) {
        for (size_t i = 0; i < 3 * (size_t)whole.vertex_count; i++)
            between.positions[i] = whole.positions[i] + (float)part / WAY_PARTS * group->maxcut[i];
        struct folds folds = folds_of(&between, NULL);
        folds = (struct folds){more(folds.crossed, before.crossed),
                               more(folds.creased, before.creased)};
        if (folds.crossed < worst.crossed ||
            (folds.crossed == worst.crossed && folds.creased <= worst.creased))
            continue;
        worst = folds;
        at = part;
    }
    mesh_fini(&whole);
    mesh_fini(&between);
    if (at > 0)
        inspection_note(out, worst.crossed ? FINDING_FAULT : FINDING_WARNING, group->name,
                        "maxcut: at %d %% of the way to it folded, %u pairs of triangles cross and "
                        "%u lie on one another",
                        100 * at / WAY_PARTS, worst.crossed, worst.creased);
}

static void inspect_maxcut(const struct case_group *group, struct inspection *out) {
    struct maxcut_report report;
    struct error err;
    if (!group->cuttable)
        return;
    if (!group->maxcut) {
        inspection_note(out, FINDING_WARNING, group->name,
                        "no maxcut: nothing of it can give way to a cut");
        return;
    }
    if (maxcut_inspect(group, &report, &err) != RESULT_OK) {
        inspection_note(out, FINDING_FAULT, group->name, "%s", err.text);
        return;
    }
    if (report.out_count > 0)
        inspection_note(
            out, report.deepest_mm > OUT_MAX_MM ? FINDING_FAULT : FINDING_WARNING, group->name,
            "maxcut: %u of %u samples stick out of S' by more than %g mm, at most %.2f mm",
            report.out_count, report.samples, MAXCUT_TOLERANCE_MM, report.deepest_mm);
    if (report.folds.crossed + report.folds.creased > 0)
        inspection_note(out, FINDING_FAULT, group->name,
                        "maxcut: folded, %u pairs of triangles cross and %u lie on one another",
                        report.folds.crossed, report.folds.creased);
    inspect_group_way(group, out);
    inspect_budget(group, &report, out);
}

static void inspect_sizes(struct knee_case *knee, struct inspection *out) {
    static const char *const bones[] = {"tibia", "femur"};
    for (int i = 0; i < 2; i++) {
        struct error err;
        if (import_check_bone(case_group(knee, bones[i]), 1, &err) != RESULT_OK)
            inspection_note(out, FINDING_FAULT, bones[i], "%s", err.text);
    }
}

// Centre of the group's box in the joint's frame; false where there is no such group.
static bool centre_of(const struct knee_case *knee, const struct case_group *group,
                      vec3 *out_centre) {
    if (!group)
        return false;
    struct box box = box_in_joint(&group->mesh, knee->joint.T_femur_joint, -INFINITY);
    *out_centre = vec3_lerp(box.min, box.max, 0.5);
    return true;
}

static void inspect_places(struct knee_case *knee, struct inspection *out) {
    vec3 femur, tibia, patella, medial, lateral;
    const struct case_group *inner = case_meniscus(knee, TISSUE_MEDIAL);
    const struct case_group *outer = case_meniscus(knee, TISSUE_LATERAL);
    bool bones = centre_of(knee, case_group(knee, "femur"), &femur) &&
                 centre_of(knee, case_group(knee, "tibia"), &tibia);
    CHECK(bones);
    vec3 up = vec3_sub(femur, tibia);
    if (up.z <= fmax(fabs(up.x), fabs(up.y)))
        inspection_note(out, FINDING_FAULT, "femur",
                        "does not lie above the tibia: is z proximal?");
    if (centre_of(knee, case_group(knee, "patella"), &patella) && patella.y <= femur.y)
        inspection_note(out, FINDING_FAULT, "patella",
                        "does not lie before the femur: is y anterior?");
    if (centre_of(knee, inner, &medial) && centre_of(knee, outer, &lateral) &&
        medial_sign(knee) * (medial.x - lateral.x) <= 0)
        inspection_note(out, FINDING_FAULT, inner->name,
                        "lies lateral of %s: is the side right, and x to the patient's right?",
                        outer->name);
    struct box box =
        box_in_joint(&case_group(knee, "femur")->mesh, knee->joint.T_femur_joint, -INFINITY);
    if (box.min.x > 0 || box.max.x < 0 || box.min.y > 0 || box.max.y < 0 || box.min.z > 30 ||
        box.max.z < 0)
        inspection_note(out, FINDING_FAULT, "joint", "its centre does not lie in the femur");
}

static double distance_to_mesh(const struct mesh *mesh, vec3 p) {
    double nearest = INFINITY;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        struct closest closest;
        closest_on_triangle(mesh, t, p, &closest);
        nearest = fmin(nearest, closest.distance);
    }
    return nearest;
}

static void inspect_portals(struct knee_case *knee, struct inspection *out) {
    const struct case_group *skin = case_skin(knee);
    for (int i = 0; i < knee->portal_count; i++) {
        const struct case_portal *portal = &knee->portals[i];
        double off = skin ? distance_to_mesh(&skin->mesh, portal->position) : 0;
        if (off > PORTAL_OFF_SKIN_MAX_MM)
            inspection_note(out, FINDING_FAULT, portal->name, "the portal is %.1f mm off the skin",
                            off);
        vec3 inwards = vec3_sub(inspect_joint_centre(knee), portal->position);
        if (vec3_dot(inwards, portal->direction) <= 0)
            inspection_note(out, FINDING_FAULT, portal->name,
                            "the portal points away from the joint");
    }
    if (knee->portal_count == 0)
        inspection_note(out, FINDING_WARNING, "portals",
                        "the case has none, so no motion can be planned");
}

void inspect_case(struct knee_case *knee, struct inspection *out_inspection) {
    *out_inspection = (struct inspection){0};
    const struct {
        const char *name;
        const struct case_group *group;
    } useful[] = {{"patella", case_group(knee, "patella")},
                  {"meniscus_medial", case_meniscus(knee, TISSUE_MEDIAL)},
                  {"meniscus_lateral", case_meniscus(knee, TISSUE_LATERAL)}};
    for (int i = 0; i < knee->group_count; i++) {
        inspect_surface(&knee->groups[i], out_inspection);
        inspect_displacements(&knee->groups[i], out_inspection);
        inspect_maxcut(&knee->groups[i], out_inspection);
    }
    for (size_t i = 0; i < sizeof useful / sizeof useful[0]; i++)
        if (!useful[i].group)
            inspection_note(out_inspection, FINDING_WARNING, useful[i].name,
                            "there is no such group");
    inspect_sizes(knee, out_inspection);
    anatomy_inspect(knee, out_inspection);
    inspect_places(knee, out_inspection);
    inspect_portals(knee, out_inspection);
}
