#include "generate/tear.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

static const double kerf = 0.15;       // width of a cleft, mm
static const double overlap = 0.05;    // of the parts of a cleft, mm
static const double spared = 1.5;      // from a cleft to the outer margin and to the ends, mm
static const double past = 1;          // past the inner margin, the lower and the upper side, mm
static const double frayed = 0.4;      // damage beyond a cleft, mm
static const double beside = 1.5;      // damage beside a radial cleft, mm
static const double beyond = 1;        // plan beyond a cleft, mm
static const double least_taken = 0.5; // by a plan, mm
static const double chord = 4; // of a part along the arc, mm; of the plan half as long again
static const int contour_cells = 8;

bool tear_kind_from_name(const char *name, enum tear_kind *out_kind) {
    static const char *const names[TEAR_KIND_COUNT] = {"radial", "flap", "bucket-handle",
                                                       "horizontal"};
    for (int i = 0; i < TEAR_KIND_COUNT; i++)
        if (strcmp(name, names[i]) == 0) {
            *out_kind = (enum tear_kind)i;
            return true;
        }
    return false;
}

// Where a tear is made. Offsets are mm along the arc at the tear's depth, rising posteriorly.
struct site {
    struct case_lesion *lesion;
    const struct arc *arc;
    struct tear tear;
    double rim;
    double per_mm; // share of the arc
    double half;   // of the damage, mm
    vec3 up;
    struct error *err;
};

static double along_at(const struct site *site, double offset) {
    return site->tear.at + offset * site->per_mm;
}

// So deep from the inner margin, halfway up.
static vec3 point_at(const struct site *site, double offset, double depth) {
    double along = along_at(site, offset), inward = arc_width(site->arc, along) - depth;
    double lower, upper;
    arc_heights(site->arc, along, inward, &lower, &upper);
    return arc_point(site->arc, (struct arc_place){along, inward, (lower + upper) / 2});
}

// ---- cells --------------------------------------------------------------------------------------

// Between upright sides over four corners, which go round in plan, and two planes.
static enum result add_cell(const struct site *site, struct case_region *region,
                            const vec3 corners[4], struct plane floor, struct plane roof) {
    struct plane planes[6] = {[4] = floor, [5] = roof};
    vec3 diagonals = vec3_cross(vec3_sub(corners[2], corners[0]), vec3_sub(corners[3], corners[1]));
    double turn = vec3_dot(diagonals, site->up) > 0 ? 1 : -1;
    for (int i = 0; i < 4; i++) {
        vec3 edge = vec3_sub(corners[(i + 1) % 4], corners[i]);
        planes[i].normal = vec3_scale(turn, vec3_cross(edge, site->up));
        planes[i].offset = vec3_dot(planes[i].normal, corners[i]);
    }
    return case_region_add(region, planes, 6, site->err);
}

// Through the whole height of the tissue.
static enum result add_prism(const struct site *site, struct case_region *region,
                             const vec3 corners[4]) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < 9; i++) {
        vec3 left = vec3_lerp(corners[0], corners[1], i % 3 / 2.0);
        vec3 right = vec3_lerp(corners[3], corners[2], i % 3 / 2.0);
        vec3 p = vec3_lerp(left, right, i / 3 / 2.0);
        struct arc_place place = arc_place(site->arc, p);
        double lower, upper, level = vec3_dot(site->up, p) - place.height;
        arc_heights(site->arc, place.along, place.inward, &lower, &upper);
        low = fmin(low, level + lower);
        high = fmax(high, level + upper);
    }
    struct plane floor = {vec3_scale(-1, site->up), past - low}, roof = {site->up, high + past};
    return add_cell(site, region, corners, floor, roof);
}

// From the inner margin to two depths at two offsets.
static enum result add_segment(const struct site *site, struct case_region *region,
                               const double offsets[2], const double depths[2]) {
    const vec3 corners[4] = {point_at(site, offsets[0], -past), point_at(site, offsets[1], -past),
                             point_at(site, offsets[1], depths[1]),
                             point_at(site, offsets[0], depths[0])};
    return add_prism(site, region, corners);
}

// ---- clefts -------------------------------------------------------------------------------------

static enum result cut_upright(const struct site *site, vec3 from, vec3 to) {
    vec3 way = vec3_sub(to, from);
    way = vec3_unit_or(vec3_add_scaled(way, -vec3_dot(way, site->up), site->up), way);
    vec3 aside = vec3_scale(kerf / 2, vec3_cross(way, site->up));
    from = vec3_add_scaled(from, -overlap, way);
    to = vec3_add_scaled(to, overlap, way);
    const vec3 corners[4] = {vec3_sub(from, aside), vec3_sub(to, aside), vec3_add(to, aside),
                             vec3_add(from, aside)};
    return add_prism(site, &site->lesion->tear, corners);
}

// Between the leaves: a flat piece, halfway up at its corners.
static enum result cut_level(const struct site *site, const double offsets[2],
                             const double depths[2]) {
    const vec3 corners[4] = {point_at(site, offsets[0] - overlap, depths[0]),
                             point_at(site, offsets[1] + overlap, depths[0]),
                             point_at(site, offsets[1] + overlap, depths[1] + overlap),
                             point_at(site, offsets[0] - overlap, depths[1] + overlap)};
    vec3 middle = vec3_lerp(vec3_lerp(corners[0], corners[1], 0.5),
                            vec3_lerp(corners[2], corners[3], 0.5), 0.5);
    vec3 normal = vec3_unit_or(
        vec3_cross(vec3_sub(corners[2], corners[0]), vec3_sub(corners[3], corners[1])), site->up);
    if (vec3_dot(normal, site->up) < 0)
        normal = vec3_scale(-1, normal);
    // A scan's tissue is twisted: neighbours still meet where their corners leave the plane.
    double level = vec3_dot(normal, middle), lift = fabs(vec3_dot(normal, corners[0]) - level);
    double half = kerf / 2 + fmax(lift - overlap, 0);
    return add_cell(site, &site->lesion->tear, corners,
                    (struct plane){vec3_scale(-1, normal), half - level},
                    (struct plane){normal, level + half});
}

// The tissue's middle rises ever more from the inner margin: two pieces follow it.
static enum result cut_between(const struct site *site, const double offsets[2]) {
    double depth = site->tear.depth_mm;
    enum result result = cut_level(site, offsets, (double[]){-past, 0.4 * depth});
    return result == RESULT_OK ? cut_level(site, offsets, (double[]){0.4 * depth, depth}) : result;
}

// Part by part between two offsets: upright at the tear's depth, or level.
static enum result cut_along(const struct site *site, double from, double to) {
    int count = (int)ceil((to - from) / chord);
    enum result result = RESULT_OK;
    for (int i = 0; i < count && result == RESULT_OK; i++) {
        double a = from + (to - from) * i / count, b = from + (to - from) * (i + 1) / count;
        if (site->tear.kind == TEAR_HORIZONTAL)
            result = cut_between(site, (double[]){a, b});
        else
            result = cut_upright(site, point_at(site, a, site->tear.depth_mm),
                                 point_at(site, b, site->tear.depth_mm));
    }
    return result;
}

static enum result cut_cleft(const struct site *site) {
    double depth = site->tear.depth_mm, half = site->tear.length_mm / 2;
    if (site->tear.kind == TEAR_RADIAL)
        return cut_upright(site, point_at(site, 0, -past), point_at(site, 0, depth));
    if (site->tear.kind != TEAR_FLAP)
        return cut_along(site, -half, half);
    enum result result =
        cut_upright(site, point_at(site, -half - past, -past), point_at(site, depth - half, depth));
    return result == RESULT_OK ? cut_along(site, depth - half, half) : result;
}

// ---- damage and plan ----------------------------------------------------------------------------

static enum result add_damage(const struct site *site) {
    double start = -site->half, depth = site->tear.depth_mm + frayed;
    enum result result = RESULT_OK;
    if (site->tear.kind == TEAR_FLAP) {
        double turn = site->tear.depth_mm - site->tear.length_mm / 2;
        result = add_segment(site, &site->lesion->damage, (double[]){start, turn},
                             (double[]){2 * frayed, depth});
        start = turn;
    }
    int count = (int)ceil((site->half - start) / chord);
    double step = (site->half - start) / count;
    for (int i = 0; i < count && result == RESULT_OK; i++)
        result = add_segment(site, &site->lesion->damage,
                             (double[]){start + i * step, start + (i + 1) * step},
                             (double[]){depth, depth});
    return result;
}

// How deep the resection goes: flat over some length, running out smoothly beside it.
static double contour(const struct site *site, double offset, double deep, double flat) {
    double run_out = 1.5 * deep;
    double t = fmin(fmax((fabs(offset) - flat) / run_out, 0), 1);
    double depth = deep * cos(PI / 2 * t) * cos(PI / 2 * t);
    return fmin(depth, arc_width(site->arc, along_at(site, offset)) - site->rim);
}

static enum result add_plan(const struct site *site, double deep, double flat) {
    double run_out = 1.5 * deep;
    int inner = (int)ceil(2 * flat / (1.5 * chord)), outer = (contour_cells - inner) / 2;
    outer = outer > 2 ? outer : 2;
    enum result result = RESULT_OK;
    for (int i = 0; i < inner + 2 * outer && result == RESULT_OK; i++) {
        double offsets[2], depths[2];
        for (int k = 0; k < 2; k++) {
            int at = i + k;
            if (at < outer)
                offsets[k] = -flat - run_out * (outer - at) / outer;
            else if (at <= outer + inner)
                offsets[k] = -flat + 2 * flat * (at - outer) / inner;
            else
                offsets[k] = flat + run_out * (at - outer - inner) / outer;
            depths[k] = contour(site, offsets[k], deep, flat);
        }
        result = add_segment(site, &site->lesion->plan, offsets, depths);
    }
    return result;
}

// ---- the tear -----------------------------------------------------------------------------------

static enum result check_place(const struct site *site) {
    const struct tear *tear = &site->tear;
    if (tear->kind == TEAR_FLAP && tear->length_mm <= tear->depth_mm)
        return fail(site->err, RESULT_INVALID, "length_mm = %g: a flap is longer than deep",
                    tear->length_mm);
    for (double offset = -tear->length_mm / 2; offset <= tear->length_mm / 2; offset += 0.5) {
        double along = along_at(site, offset), width = arc_width(site->arc, along);
        if (fmin(along, 1 - along) < spared * site->per_mm)
            return fail(site->err, RESULT_INVALID, "it reaches an end of the meniscus");
        if (width < tear->depth_mm + spared)
            return fail(site->err, RESULT_INVALID,
                        "depth_mm = %g: at %.2f of the arc the meniscus is %.1f mm wide, and %g mm "
                        "must stay whole",
                        tear->depth_mm, along, width, spared);
    }
    return RESULT_OK;
}

enum result tear_add(struct case_group *group, const struct arc *arc, const struct tear *tear,
                     double rim_mm, struct error *err) {
    double radius = arc_radius(arc, tear->at) - arc_width(arc, tear->at) + tear->depth_mm;
    struct site site = {.lesion = &group->lesion,
                        .arc = arc,
                        .tear = *tear,
                        .rim = rim_mm,
                        .per_mm = 1 / (arc_angle(arc) * radius),
                        .half = tear->kind == TEAR_RADIAL ? beside : tear->length_mm / 2 + frayed,
                        .up = arc_up(arc),
                        .err = err};
    enum result result = check_place(&site);
    if (result == RESULT_OK)
        result = cut_cleft(&site);
    if (result == RESULT_OK)
        result = add_damage(&site);
    if (result == RESULT_OK)
        result = add_plan(&site, tear->depth_mm + beyond, site.half + beyond / 2);
    return result;
}

// ---- a plan of its own --------------------------------------------------------------------------

static enum result check_width(const struct site *site, double half) {
    for (double offset = -half; offset <= half; offset += 0.5) {
        double along = along_at(site, offset), width = arc_width(site->arc, along);
        if (fmin(along, 1 - along) < spared * site->per_mm)
            return fail(site->err, RESULT_INVALID, "it reaches an end of the meniscus");
        if (width < site->rim + least_taken)
            return fail(site->err, RESULT_INVALID,
                        "at %.2f of the arc the meniscus is %.1f mm wide, and %g mm must stay",
                        along, width, site->rim);
    }
    return RESULT_OK;
}

enum result plan_set(struct case_group *group, const struct arc *arc,
                     const struct resection *resection, double rim_mm, struct error *err) {
    double width = arc_width(arc, resection->at), depth = resection->depth_mm;
    double radius = arc_radius(arc, resection->at) - width + depth;
    struct case_lesion planned = {0};
    struct site site = {.lesion = &planned,
                        .arc = arc,
                        .tear = {.at = resection->at},
                        .rim = rim_mm,
                        .per_mm = 1 / (arc_angle(arc) * radius),
                        .up = arc_up(arc),
                        .err = err};
    enum result result = check_width(&site, resection->length_mm / 2);
    if (result == RESULT_OK)
        result = add_plan(&site, depth, resection->length_mm / 2);
    struct case_region *old = result == RESULT_OK ? &group->lesion.plan : &planned.plan;
    free(old->parts);
    if (result == RESULT_OK)
        group->lesion.plan = planned.plan;
    return result;
}
