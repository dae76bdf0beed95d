#include "generate/maxcut.h"

#include "base/check.h"
#include "case/arc.h"
#include "generate/maxcut_polish.h"
#include "generate/shape.h"

#include <stdlib.h>

#define SECTORS 120 // of the arc, each with a rim of its own

static const double inset_way = 0.5;         // moved so far, the whole inset
static const double firm = 0.95;             // relative heights beyond it are drawn in
static const double least_half = 0.4;        // of the height where it runs out at a margin, mm
static const double root_share = 0.08, all_share = 0.25; // shares of the arc from an end: nothing, the whole
static const double hollow = 0.2;            // so far outside S' the rim is widened, mm
static const double widening = 0.5, steepest = 0.7; // mm a round; mm a mm along the margin

struct shape {
    const struct arc *arc;
    double rim; // asked for
    double rims[SECTORS];
};

static double rim_at(const struct shape *shape, double along) {
    double at = fmin(fmax(along, 0), 1) * (SECTORS - 1);
    int i = (int)fmin(at, SECTORS - 2);
    return shape->rims[i] + (at - i) * (shape->rims[i + 1] - shape->rims[i]);
}

static double inward_after(const struct shape *shape, struct arc_place place) {
    double rim = rim_at(shape, place.along), kept = rim - shape->rim / 2;
    double width = arc_width(shape->arc, place.along);
    if (width <= rim || place.inward <= kept)
        return place.inward;
    double squeezed = kept + (place.inward - kept) * (rim - kept) / (width - kept);
    double share = shape_ramp(root_share, all_share, fmin(place.along, 1 - place.along));
    return place.inward + share * (squeezed - place.inward);
}

static double half_height(double lower, double upper) {
    double half = (upper - lower) / 2;
    return half > least_half ? half : least_half - (least_half - half) / 2;
}

// At the inner margin, where the height runs out, points are beyond the sides that were measured.
static double within(double relative) {
    double size = fabs(relative), rest = (size - firm) / (1 - firm);
    return size <= firm ? relative : copysign(firm + (1 - firm) * tanh(rest), relative);
}

static vec3 resected(const struct shape *shape, vec3 p) {
    struct arc_place from = arc_place(shape->arc, p), to = from;
    to.inward = inward_after(shape, from);
    if (to.inward == from.inward)
        return p;
    double lower, upper, to_lower, to_upper;
    arc_heights(shape->arc, from.along, from.inward, &lower, &upper);
    arc_heights(shape->arc, to.along, to.inward, &to_lower, &to_upper);
    double relative = (from.height - (lower + upper) / 2) / half_height(lower, upper);
    double moved = shape_ramp(0, inset_way, from.inward - to.inward);
    relative += moved * (within(relative) - relative);
    double half = (to_upper - to_lower) / 2 - MAXCUT_INSET_MM * moved;
    to.height = (to_lower + to_upper) / 2 + relative * half;
    return arc_point(shape->arc, to);
}

// ---- where S' is hollow -------------------------------------------------------------------------

static int sector_of(const struct shape *shape, vec3 p) {
    double along = arc_place(shape->arc, p).along;
    return (int)lround(fmin(fmax(along, 0), 1) * (SECTORS - 1));
}

// No step of the rim along the margin is steeper than allowed.
static void even_out(struct shape *shape) {
    for (int i = 1; i < SECTORS; i++) {
        double sector = arc_angle(shape->arc) / (SECTORS - 1) *
                        arc_radius(shape->arc, (double)i / (SECTORS - 1));
        shape->rims[i] = fmax(shape->rims[i], shape->rims[i - 1] - steepest * sector);
    }
    for (int i = SECTORS - 1; i > 0; i--) {
        double sector = arc_angle(shape->arc) / (SECTORS - 1) *
                        arc_radius(shape->arc, (double)i / (SECTORS - 1));
        shape->rims[i - 1] = fmax(shape->rims[i - 1], shape->rims[i] - steepest * sector);
    }
}

// Whether vertices lie far outside S', and which.
static bool find_hollows(const struct solid *tissue, const struct mesh *least, bool *out_hollow) {
    bool any = false;
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < least->vertex_count; v++) {
        out_hollow[v] = solid_distance(tissue, mesh_vertex(least, v), &hint) > hollow;
        any |= out_hollow[v];
    }
    return any;
}

static void widen(struct shape *shape, const struct mesh *least, const bool *unfit) {
    bool wider[SECTORS] = {false};
    for (uint32_t v = 0; v < least->vertex_count; v++)
        if (unfit[v])
            wider[sector_of(shape, mesh_vertex(least, v))] = true;
    for (int i = 0; i < SECTORS; i++)
        if (wider[i])
            shape->rims[i] += widening;
    even_out(shape);
}

// ---- making -------------------------------------------------------------------------------------

static bool is_wider(const struct arc *arc, double rim) {
    for (double along = root_share; along < 1 - root_share; along += 0.01)
        if (arc_width(arc, along) > rim)
            return true;
    return false;
}

static void take_maxcut(struct case_group *group, const struct mesh *whole,
                        const struct mesh *least) {
    float *maxcut = case_group_need_maxcut(group);
    for (size_t i = 0; i < 3 * (size_t)whole->vertex_count; i++)
        maxcut[i] = least->positions[i] - whole->positions[i];
}

static enum result make(struct case_group *group, const struct mesh *whole, const struct arc *arc,
                        double rim_mm, struct error *err) {
    struct shape shape = {.arc = arc, .rim = rim_mm};
    struct solid tissue;
    struct mesh least;
    if (!is_wider(arc, rim_mm))
        return fail(err, RESULT_INVALID, "nowhere wider than a rim of %g mm", rim_mm);
    for (int i = 0; i < SECTORS; i++)
        shape.rims[i] = rim_mm;
    enum result result = solid_init(&tissue, whole, err);
    mesh_copy(&least, whole);
    bool *unfit = alloc(whole->vertex_count, sizeof *unfit);
    for (int round = 0; result == RESULT_OK && round < 2 * arc_radius(arc, 0.5) / widening;
         round++) {
        for (uint32_t v = 0; v < whole->vertex_count; v++)
            mesh_set_vertex(&least, v, resected(&shape, mesh_vertex(whole, v)));
        if (!find_hollows(&tissue, &least, unfit) && maxcut_polish(&tissue, &least, unfit))
            break;
        widen(&shape, &least, unfit);
    }
    if (result == RESULT_OK)
        take_maxcut(group, whole, &least);
    free(unfit);
    mesh_fini(&least);
    solid_fini(&tissue);
    return result;
}

enum result maxcut_make(struct case_group *group, pose T_body_joint, double rim_mm,
                        struct error *err) {
    if (!group->cuttable)
        return fail(err, RESULT_INVALID, "group %s cannot be cut", group->name);
    struct mesh whole;
    struct arc *arc;
    case_group_virtual(group, &whole);
    enum result result = arc_create(&whole, T_body_joint, &arc, err);
    if (result == RESULT_OK)
        result = make(group, &whole, arc, rim_mm, err);
    arc_destroy(&arc);
    mesh_fini(&whole);
    return result == RESULT_OK ? result : fail_in(err, result, "group %s: ", group->name);
}
