#include "warp/avatar.h"

#include "base/check.h"
#include "warp/avatar_fit.h"

#include <string.h>

#define FADE_FROM_MM 5
#define FADE_TO_MM 15
#define TRUST_LEAST_MM 0.1

void avatar_memory_init(struct avatar_memory *memory) {
    for (int i = 0; i < AVATAR_POINTS_MAX; i++)
        warp_memory_init(&memory->points[i]);
}

static struct axis axis_of(pose T_world_tip, vec3 portal) {
    struct axis axis = {
        .u = quat_rotate(T_world_tip.rotation, (vec3){0, 0, 1}),
        .e = {quat_rotate(T_world_tip.rotation, (vec3){1, 0, 0}),
              quat_rotate(T_world_tip.rotation, (vec3){0, 1, 0})},
        .aside = vec3_sub(portal, T_world_tip.translation),
    };
    axis.portal = vec3_dot(axis.u, axis.aside);
    return axis;
}

// ---- points of the body in the field ------------------------------------------------------------

// h = x² (3 − 2x)
static double fade_in(double past_portal_mm, double *out_slope) {
    double width = FADE_TO_MM - FADE_FROM_MM, x = (past_portal_mm - FADE_FROM_MM) / width;
    x = fmin(fmax(x, 0), 1);
    *out_slope = 6 * x * (1 - x) / width;
    return x * x * (3 - 2 * x);
}

static void look(const struct warp_scene *scene, const struct field *field,
                 const struct avatar_body *body, pose T, struct avatar_memory *memory,
                 struct fit *out) {
    out->radius_mm = field->radius_mm;
    out->shown = fade_in(-out->axis.portal, &out->shown_slope);
    out->count = body->mode == AVATAR_TIP ? 1 : body->point_count;
    for (int i = 0; i < out->count; i++) {
        struct fit_point *p = &out->points[i];
        vec3 at = body->points[i].at;
        p->arm = quat_rotate(T.rotation, at);
        p->along = at.z - out->axis.portal;
        p->beside = quat_rotate(T.rotation, (vec3){at.x, at.y, 0});
        p->radius = body->points[i].radius_mm;
        p->heard = fade_in(p->along, &p->heard_slope);
        p->count = 0;
        if (i == 0 || p->heard > 0)
            p->count = warp_contacts(scene, field, vec3_add(T.translation, p->arm),
                                     &memory->points[i], &p->warp, p->contacts);
    }
}

// ---- the modes ----------------------------------------------------------------------------------

static void add_row(double row[6], vec3 way, vec3 turn) {
    const double added[6] = {way.x, way.y, way.z, turn.x, turn.y, turn.z};
    for (int k = 0; k < 6; k++)
        row[k] += added[k];
}

static void follow_tip(const struct fit *fit, struct avatar *out) {
    const struct warp *warp = &fit->points[0].warp;
    out->extrapolation.motion.v = warp->displacement;
    for (int i = 0; i < 3; i++)
        memcpy(out->extrapolation.slope[i], warp->gradient.m[i], sizeof warp->gradient.m[i]);
}

// Ω = h Σ_k ω_k of a point, and over the point's way and h.
static double loudness(const struct fit *fit, const struct fit_point *p, vec3 *out_slope,
                       double *out_by_heard) {
    double sum = 0;
    vec3 slope = {0};
    for (int k = 0; k < p->count; k++) {
        struct fit_weight weight = fit_weigh(fit, p, &p->contacts[k]);
        sum += weight.value;
        slope = vec3_add_scaled(slope, weight.slope, p->contacts[k].normal);
    }
    *out_slope = vec3_scale(p->heard, slope);
    *out_by_heard = sum;
    return p->heard * sum;
}

// V = H Σ Ω W / Σ Ω;  dV = Σ ((H W − V) dΩ + Ω d(H W)) / Σ Ω, where h and H go with P along u.
static void add_mean_slopes(const struct fit *fit, const struct fit_point *p, double sum,
                            struct avatar *out) {
    const struct axis *axis = &fit->axis;
    vec3 slope, W = p->warp.displacement;
    double by_heard, weight = loudness(fit, p, &slope, &by_heard);
    vec3 off = vec3_add_scaled(vec3_scale(fit->shown, W), -1, out->extrapolation.motion.v);
    mat3 place = mat3_add_scaled(mat3_outer(off, slope), weight * fit->shown, p->warp.gradient);
    vec3 fading = vec3_scale(by_heard * p->heard_slope / sum, off);
    fading = vec3_add_scaled(fading, weight * fit->shown_slope / sum, W);
    vec3 portal_turn = vec3_cross(axis->u, axis->aside);
    const double fades[3] = {fading.x, fading.y, fading.z};
    for (int i = 0; i < 3; i++) {
        vec3 row = {place.m[i][0] / sum, place.m[i][1] / sum, place.m[i][2] / sum};
        vec3 turn = vec3_add_scaled(vec3_cross(p->arm, row), -fades[i], portal_turn);
        add_row(out->extrapolation.slope[i], vec3_add_scaled(row, fades[i], axis->u), turn);
    }
}

static void follow_mean(const struct fit *fit, struct avatar *out) {
    vec3 mean = {0}, slope;
    double sum = 0, by_heard;
    for (int i = 0; i < fit->count; i++) {
        const struct fit_point *p = &fit->points[i];
        if (!p->count) // nor has it a warp
            continue;
        double weight = loudness(fit, p, &slope, &by_heard);
        mean = vec3_add_scaled(mean, weight, p->warp.displacement);
        sum += weight;
    }
    if (!(sum > 0))
        return;
    out->extrapolation.motion.v = vec3_scale(fit->shown / sum, mean);
    for (int i = 0; i < fit->count; i++)
        if (fit->points[i].count)
            add_mean_slopes(fit, &fit->points[i], sum, out);
}

// v turns with the hand, and so do e.
static void follow_fit(const struct fit *fit, struct avatar *out) {
    const vec3 *e = fit->axis.e;
    double q[3], slope[3][6];
    fit_find(fit, q, slope);
    out->extrapolation.motion.v = vec3_add_scaled(vec3_scale(q[0], e[0]), q[1], e[1]);
    out->extrapolation.motion.s = q[2];
    for (int k = 0; k < 6; k++) {
        vec3 around = {k == 3, k == 4, k == 5};
        vec3 v = vec3_add_scaled(vec3_scale(slope[0][k], e[0]), slope[1][k], e[1]);
        v = vec3_add(v, vec3_cross(around, out->extrapolation.motion.v));
        out->extrapolation.slope[0][k] = v.x;
        out->extrapolation.slope[1][k] = v.y;
        out->extrapolation.slope[2][k] = v.z;
        out->extrapolation.slope[3][k] = slope[2][k];
    }
}

// fmax may say 0 or -0, as the compiler likes; here and below.
static double reach_of(const struct avatar_body *body) {
    double reach = 0;
    for (int i = 0; body->mode != AVATAR_TIP && i < body->point_count; i++)
        if (-body->points[i].at.z > reach)
            reach = -body->points[i].at.z;
    return reach;
}

// ---- what comes of it ---------------------------------------------------------------------------

static void measure_depth(const struct fit_point *p, vec3 displacement, struct avatar *out) {
    for (int k = 0; k < p->count; k++) {
        const struct warp_contact *c = &p->contacts[k];
        double rise = vec3_dot(c->normal, vec3_sub(displacement, c->delta));
        double deep = -rise - fmax(c->distance - p->radius, 0);
        if (deep > out->penetration_mm)
            out->penetration_mm = deep;
    }
}

// Weights and holds change over distances like a point's gap.
static double trust(const struct fit_point *p) {
    double reach = 2 * (p->warp.nearest_mm - p->radius);
    return fmin(p->warp.trust_radius_mm, fmax(reach, TRUST_LEAST_MM));
}

static void measure_tip(const struct fit_point *tip, struct avatar *out) {
    for (int k = 0; k < tip->count; k++) {
        const struct warp_contact *c = &tip->contacts[k];
        if (c->surface == tip->warp.nearest)
            out->tip_gap_mm = vec3_dot(c->normal, vec3_sub(out->displacement[0], c->delta));
    }
}

static void measure(const struct fit *fit, const struct avatar_body *body, pose T,
                    struct avatar *out) {
    out->tip = fit->points[0].warp;
    out->extrapolation.trust_radius_mm = out->tip.trust_radius_mm;
    for (int i = 0; i < body->point_count; i++) {
        vec3 at = body->points[i].at;
        out->displacement[i] = vec3_sub(pose_apply(out->T_world_warped, at), pose_apply(T, at));
    }
    for (int i = 0; i < fit->count; i++) {
        const struct fit_point *p = &fit->points[i];
        if (!p->count)
            continue;
        if (body->mode != AVATAR_TIP)
            out->extrapolation.trust_radius_mm = fmin(out->extrapolation.trust_radius_mm, trust(p));
        measure_depth(p, out->displacement[i], out);
    }
    measure_tip(&fit->points[0], out);
}

void avatar_warp(const struct warp_scene *scene, const struct field *field,
                 const struct avatar_body *body, vec3 portal, pose T_world_tip,
                 struct avatar_memory *memory, struct avatar *out) {
    CHECK(body->point_count >= 1 && body->point_count <= AVATAR_POINTS_MAX);
    CHECK(vec3_length(body->points[0].at) == 0);
    struct fit fit;
    fit.axis = axis_of(T_world_tip, portal);
    look(scene, field, body, T_world_tip, memory, &fit);
    memset(out, 0, sizeof *out);
    out->extrapolation.mode = body->mode;
    if (body->mode != AVATAR_TIP)
        out->extrapolation.portal = portal;
    out->extrapolation.reach_mm = reach_of(body);
    switch (body->mode) {
    case AVATAR_TIP:
        follow_tip(&fit, out);
        break;
    case AVATAR_POINTS:
        follow_mean(&fit, out);
        break;
    default:
        follow_fit(&fit, out);
        break;
    }
    out->T_world_warped = avatar_place(body->mode, portal, &out->extrapolation.motion, T_world_tip);
    measure(&fit, body, T_world_tip, out);
}
