#include "base/check.h"
#include "case/arc.h"
#include "landmarks/joint.h"
#include "mesh/query.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

// Footprints where a ligament has no mesh, as shares of the plateau (from its anterior margin, from
// the middle to lateral) and of the condyles' radius (from the flexion axis). On the tibia after
// Stäubli and Rauschning (1994) and Moorman (2008), on the femur after Bernard (1997).
static const double acl_depth = 0.43, pcl_depth = 0.95, pcl_below = 8;
static const double acl_up = 0.15, acl_behind = 0.3, pcl_up = -0.05, pcl_before = 0.15;
static const double footprint_error = 10;
static const double wall_drop = 6;     // mm of a condyle's inner wall below its ridge
static const double roof_before = 0.2; // condyle's radii before the axis: where the roof is named
static const double roof_slope = 0.35; // from the notch's anterior margin up to there, at most

struct finder {
    struct knee_case *knee;
    struct condyles condyles;
    struct profile bottom, tibia;
    vec3 plateaus[COMPARTMENT_COUNT]; // local
    double notch_x;
    struct landmarks_notes *notes;
    struct error *err;
    enum result result;
};

void landmarks_note(struct landmarks_notes *notes, const char *format, ...) {
    if (!notes || notes->count == LANDMARKS_NOTES_MAX)
        return;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(notes->texts[notes->count++], sizeof notes->texts[0], format, arguments);
    va_end(arguments);
}

static void put(struct finder *f, const char *name, enum body body, vec3 local, double error_mm) {
    const struct case_landmark *known = case_landmark(f->knee, name);
    struct case_landmark landmark = {
        .body = body, .at = from_local(&f->condyles.local, local), .error_mm = error_mm};
    snprintf(landmark.name, sizeof landmark.name, "%s", name);
    if (f->result != RESULT_OK || (known && known->by_hand))
        return;
    if (vec3_is_finite(local) && isfinite(error_mm))
        f->result = case_landmark_set(f->knee, &landmark, f->err);
    else
        landmarks_note(f->notes, "%s is not found: the %s has no surface there", name,
                       body_name(body));
}

static void put_side(struct finder *f, const char *name, int side, enum body body, vec3 local,
                     double error_mm) {
    char text[CASE_NAME_MAX];
    snprintf(text, sizeof text, "%s_%s", name, side == COMPARTMENT_LATERAL ? "lateral" : "medial");
    put(f, text, body, local, error_mm);
}

// ---- the femur ----------------------------------------------------------------------------------

static void find_condyles(struct finder *f) {
    for (int i = 0; i < COMPARTMENT_COUNT; i++) {
        double x = f->condyles.ridge_x[i], radius = profile_radius(&f->condyles.femur, x, 0);
        put_side(f, "condyle", i, BODY_FEMUR, profile_place(x, 0, radius),
                 f->condyles.fits[i].rms_mm);
    }
}

// Where across the femur its surface lies deepest between the ridges.
static double deepest_x(const struct finder *f, double angle, double *out_radius) {
    double from = f->condyles.ridge_x[COMPARTMENT_MEDIAL] / 2;
    double to = f->condyles.ridge_x[COMPARTMENT_LATERAL] / 2, least = INFINITY, at = NAN;
    for (double x = from; x <= to; x += 0.5) {
        double radius = profile_radius(&f->condyles.femur, x, angle);
        if (radius < least) {
            least = radius;
            at = x;
        }
    }
    *out_radius = least;
    return at;
}

// Where across the femur a condyle's inner wall has fallen off from its ridge, or ends.
static double wall_x(const struct finder *f, int side, double angle) {
    double x = f->condyles.ridge_x[side], step = x > 0 ? -0.25 : 0.25;
    double ridge = profile_radius(&f->condyles.femur, x, angle);
    while (fabs(x) > 0.5 && profile_radius(&f->condyles.femur, x, angle) > ridge - wall_drop)
        x += step;
    return x;
}

// From there to the front, the first place that has a surface above it which is not hidden by the
// notch's anterior margin, the most distal place. Not finite: none.
static vec3 roof_from(const struct finder *f, vec3 at) {
    double front = at.y + 2 * f->condyles.fits[0].radius_mm;
    vec3 margin = {at.x, at.y, INFINITY};
    for (double y = at.y; y < front; y += 0.5) {
        double z = -profile_height(&f->bottom, at.x, y);
        if (z < margin.z)
            margin = (vec3){at.x, y, z};
    }
    do
        at.z = -profile_height(&f->bottom, at.x, at.y);
    while (!(at.z - margin.z <= roof_slope * (margin.y - at.y)) && (at.y += 0.5) <= margin.y);
    return at;
}

// The roof of the notch, in the middle between the condyles' inner walls. A femur that is a sheet
// of its joint's surface has none: then it is put where the sheet begins.
static void find_notch(struct finder *f) {
    double sum = 0, squares = 0, error = 0;
    int count = 0;
    for (double angle = 40; angle <= 90; angle += 2, count++) {
        double x =
            (wall_x(f, COMPARTMENT_MEDIAL, angle) + wall_x(f, COMPARTMENT_LATERAL, angle)) / 2;
        sum += x;
        squares += x * x;
    }
    f->notch_x = sum / count;
    error = sqrt(fmax(squares / count - f->notch_x * f->notch_x, 0));
    double y = roof_before * f->condyles.fits[0].radius_mm;
    vec3 roof = roof_from(f, (vec3){f->notch_x, y, NAN});
    bool is_whole = isfinite(profile_height(&f->bottom, f->notch_x, y));
    put(f, "notch", BODY_FEMUR, roof, is_whole ? error : footprint_error);
}

// The most anterior place of the groove.
static void find_trochlea(struct finder *f) {
    double x_sum = 0, weights = 0, squares = 0, most = -INFINITY, radius, best = NAN;
    for (double angle = -110; angle <= -40; angle++) {
        double x = deepest_x(f, angle, &radius);
        double y = profile_place(x, angle, radius).y;
        if (isfinite(x) && y > most) {
            most = y;
            best = angle;
        }
    }
    for (double angle = best - 10; angle <= best + 10; angle++) {
        double x = deepest_x(f, angle, &radius);
        if (isnan(x))
            continue;
        x_sum += x;
        squares += x * x;
        weights++;
    }
    double x = x_sum / weights;
    radius = profile_radius(&f->condyles.femur, x, best);
    put(f, "trochlea", BODY_FEMUR, profile_place(x, best, radius),
        sqrt(fmax(squares / weights - x * x, 0)));
}

// ---- the tibia ----------------------------------------------------------------------------------

// The middle of what lies within `drop` of the height under the condyle's ridge.
static vec3 middle_of_plateau(const struct finder *f, int side, double drop) {
    double ridge = f->condyles.ridge_x[side], level = profile_height(&f->tibia, ridge, 0);
    vec3 sum = {0};
    int count = 0;
    for (double x = -14; x <= 14; x += 0.5)
        for (double y = -30; y <= 30; y += 0.5) {
            double height = profile_height(&f->tibia, ridge + x, y);
            if (fabs(height - level) < drop) {
                sum = vec3_add(sum, (vec3){ridge + x, y, height});
                count++;
            }
        }
    vec3 middle = vec3_scale(1.0 / count, sum);
    middle.z = profile_height(&f->tibia, middle.x, middle.y);
    return middle;
}

static void find_plateaus(struct finder *f) {
    for (int i = 0; i < COMPARTMENT_COUNT; i++) {
        f->plateaus[i] = middle_of_plateau(f, i, 5);
        double error = vec3_distance(f->plateaus[i], middle_of_plateau(f, i, 4));
        put_side(f, "plateau", i, BODY_TIBIA, f->plateaus[i], error);
    }
}

// ---- ligaments ----------------------------------------------------------------------------------

// The long axis of a cloud: of its largest spread, upwards.
static vec3 long_axis(const vec3 *points, uint32_t count, vec3 *out_middle) {
    vec3 middle = {0}, axis = {0.1, 0.2, 1};
    mat3 spread = {0};
    for (uint32_t v = 0; v < count; v++)
        middle = vec3_add_scaled(middle, 1.0 / count, points[v]);
    for (uint32_t v = 0; v < count; v++) {
        vec3 d = vec3_sub(points[v], middle);
        spread = mat3_add_scaled(spread, 1.0 / count, mat3_outer(d, d));
    }
    for (int i = 0; i < 60; i++)
        axis = vec3_unit_or(mat3_apply(spread, axis), axis);
    *out_middle = middle;
    return axis.z < 0 ? vec3_scale(-1, axis) : axis;
}

// The middle of what lies within `length` of the cloud's end along an axis.
static vec3 end_of(const vec3 *points, uint32_t count, vec3 axis, double length) {
    double most = -INFINITY;
    vec3 sum = {0};
    int near = 0;
    for (uint32_t v = 0; v < count; v++)
        most = fmax(most, vec3_dot(points[v], axis));
    for (uint32_t v = 0; v < count; v++)
        if (vec3_dot(points[v], axis) > most - length) {
            sum = vec3_add(sum, points[v]);
            near++;
        }
    return vec3_scale(1.0 / near, sum);
}

static void put_ends(struct finder *f, const char *name, const struct mesh *mesh) {
    char text[2][CASE_NAME_MAX];
    snprintf(text[0], sizeof text[0], "%s_femur", name);
    snprintf(text[1], sizeof text[1], "%s_tibia", name);
    vec3 *points = local_points(&f->condyles.local, mesh), middle;
    vec3 axis = long_axis(points, mesh->vertex_count, &middle);
    for (int i = 0; i < 2; i++) {
        vec3 end = end_of(points, mesh->vertex_count, axis, 3);
        double error = vec3_distance(end, end_of(points, mesh->vertex_count, axis, 6));
        put(f, text[i], i ? BODY_TIBIA : BODY_FEMUR, end, error);
        axis = vec3_scale(-1, axis);
    }
    free(points);
}

static vec3 on_surface(const struct finder *f, const char *group, vec3 local) {
    struct query *query;
    struct closest closest = {0};
    struct error why;
    if (!vec3_is_finite(local) ||
        query_create(&case_group(f->knee, group)->mesh, &query, &why) != RESULT_OK)
        return (vec3){NAN, NAN, NAN};
    bool found =
        query_closest(query, from_local(&f->condyles.local, local), INFINITY, MESH_NONE, &closest);
    query_destroy(&query);
    return found ? to_local(&f->condyles.local, closest.point) : (vec3){NAN, NAN, NAN};
}

// From the front to the back of the plateau, between both compartments.
static vec3 between_plateaus(const struct finder *f, double share) {
    vec3 middle = vec3_lerp(f->plateaus[0], f->plateaus[1], 0.5);
    double front = middle.y, back = middle.y;
    for (int i = 0; i < COMPARTMENT_COUNT; i++)
        for (double y = -35; y <= 35; y += 0.5)
            if (profile_height(&f->tibia, f->plateaus[i].x, y) > f->plateaus[i].z - 6) {
                front = fmax(front, y);
                back = fmin(back, y);
            }
    double y = front + share * (back - front), z = profile_height(&f->tibia, middle.x, y);
    return (vec3){middle.x, y, isnan(z) ? middle.z : z};
}

// On the inner wall of a condyle; so far from the flexion axis, in radii.
static vec3 on_inner_wall(const struct finder *f, int side, double anterior, double up) {
    double r = f->condyles.fits[side].radius_mm;
    double x = (f->notch_x + f->condyles.ridge_x[side]) / 2;
    return on_surface(f, "femur", (vec3){x, anterior * r, up * r});
}

// The feet of ligaments that have no mesh.
static void find_feet(struct finder *f) {
    if (!case_group(f->knee, "acl")) {
        put(f, "acl_tibia", BODY_TIBIA, between_plateaus(f, acl_depth), footprint_error);
        put(f, "acl_femur", BODY_FEMUR, on_inner_wall(f, COMPARTMENT_LATERAL, -acl_behind, acl_up),
            footprint_error);
    }
    if (!case_group(f->knee, "pcl")) {
        vec3 back = vec3_add_scaled(between_plateaus(f, pcl_depth), -pcl_below, (vec3){0, 0, 1});
        put(f, "pcl_tibia", BODY_TIBIA, on_surface(f, "tibia", back), footprint_error);
        put(f, "pcl_femur", BODY_FEMUR, on_inner_wall(f, COMPARTMENT_MEDIAL, pcl_before, pcl_up),
            footprint_error);
    }
}

static void find_ligaments(struct finder *f) {
    static const char *const names[] = {"acl", "pcl"};
    for (int i = 0; i < 2; i++) {
        const struct case_group *ligament = case_group(f->knee, names[i]);
        if (ligament)
            put_ends(f, names[i], &ligament->mesh);
    }
}

// ---- menisci and patella ------------------------------------------------------------------------

static vec3 in_meniscus(const struct finder *f, const struct arc *arc, double along) {
    double inward = arc_width(arc, along) / 2, lower, upper;
    arc_heights(arc, along, inward, &lower, &upper);
    struct arc_place place = {along, inward, (lower + upper) / 2};
    return to_local(&f->condyles.local, arc_point(arc, place));
}

static const struct {
    const char *name;
    double along;
} meniscus_places[] = {{"root_anterior", 0.02},
                       {"horn_anterior", 0.15},
                       {"body", 0.5},
                       {"horn_posterior", 0.85},
                       {"root_posterior", 0.98}};

// How sure: how far the place moves along the meniscus with a hundredth of its arc.
static void find_menisci(struct finder *f) {
    static const enum tissue_side sides[] = {
        [COMPARTMENT_MEDIAL] = TISSUE_MEDIAL, [COMPARTMENT_LATERAL] = TISSUE_LATERAL};
    for (int i = 0; i < COMPARTMENT_COUNT; i++) {
        const struct case_group *group = case_meniscus(f->knee, sides[i]);
        struct arc *arc;
        struct error why;
        if (!group)
            continue;
        if (arc_create(&group->mesh, f->knee->joint.T_tibia_joint, &arc, &why) != RESULT_OK) {
            landmarks_note(f->notes, "no landmarks of %s are found: %s", group->name, why.text);
            continue;
        }
        for (size_t k = 0; k < sizeof meniscus_places / sizeof *meniscus_places; k++) {
            double along = meniscus_places[k].along;
            vec3 place = in_meniscus(f, arc, along);
            double error =
                vec3_distance(in_meniscus(f, arc, along - 0.01), in_meniscus(f, arc, along + 0.01));
            put_side(f, meniscus_places[k].name, i, BODY_TIBIA, place, error);
        }
        arc_destroy(&arc);
    }
}

static void find_patella(struct finder *f) {
    const struct case_group *group = case_group(f->knee, "patella");
    if (!group)
        return;
    vec3 sum = {0};
    double area = 0;
    for (uint32_t t = 0; t < group->mesh.triangle_count; t++) {
        vec3 a = mesh_corner(&group->mesh, t, 0), b = mesh_corner(&group->mesh, t, 1),
             c = mesh_corner(&group->mesh, t, 2);
        double size = vec3_length(vec3_cross(vec3_sub(b, a), vec3_sub(c, a))) / 2;
        sum = vec3_add_scaled(sum, size / 3, vec3_add(a, vec3_add(b, c)));
        area += size;
    }
    struct box box = mesh_bounds(&group->mesh);
    vec3 middle = vec3_scale(1 / area, sum);
    put(f, "patella", BODY_PATELLA, to_local(&f->condyles.local, middle),
        vec3_distance(middle, vec3_lerp(box.min, box.max, 0.5)));
}

enum result landmarks_find(struct knee_case *knee, struct landmarks_notes *notes,
                           struct error *err) {
    struct finder f = {.knee = knee, .notes = notes, .err = err};
    enum result fitted = condyles_fit(&f.condyles, knee, err);
    if (fitted == RESULT_OK) {
        profile_bottom(&f.bottom, &f.condyles.local, &case_group(knee, "femur")->mesh);
        profile_top(&f.tibia, &f.condyles.local, &case_group(knee, "tibia")->mesh);
        find_condyles(&f);
        find_notch(&f);
        find_trochlea(&f);
        find_plateaus(&f);
        find_feet(&f);
        profile_fini(&f.bottom);
        profile_fini(&f.tibia);
    }
    find_ligaments(&f);
    find_menisci(&f);
    find_patella(&f);
    condyles_fini(&f.condyles);
    return f.result == RESULT_OK ? fitted : f.result;
}
