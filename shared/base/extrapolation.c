#include "base/extrapolation.h"

#include "base/turn.h"

#include <string.h>

const char *avatar_mode_name(enum avatar_mode mode) {
    static const char *const names[AVATAR_MODE_COUNT] = {"tip", "points", "rigid"};
    return (unsigned)mode < AVATAR_MODE_COUNT ? names[mode] : "unknown";
}

bool avatar_mode_from_name(const char *name, enum avatar_mode *out_mode) {
    for (int i = 0; i < AVATAR_MODE_COUNT; i++)
        if (!strcmp(name, avatar_mode_name((enum avatar_mode)i))) {
            *out_mode = (enum avatar_mode)i;
            return true;
        }
    return false;
}

pose avatar_place(enum avatar_mode mode, vec3 portal, const struct avatar_motion *motion,
                  pose tip) {
    if (mode != AVATAR_RIGID)
        return (pose){tip.rotation, vec3_add(tip.translation, motion->v)};
    vec3 u = quat_rotate(tip.rotation, (vec3){0, 0, 1});
    const vec3 e[2] = {quat_rotate(tip.rotation, (vec3){1, 0, 0}),
                       quat_rotate(tip.rotation, (vec3){0, 1, 0})};
    const double v[2] = {vec3_dot(e[0], motion->v), vec3_dot(e[1], motion->v)};
    if (v[0] == 0 && v[1] == 0 && motion->s == 0)
        return tip;
    struct turn turn = turn_into(u, e, v);
    double along = vec3_dot(u, vec3_sub(portal, tip.translation));
    vec3 P = vec3_add_scaled(tip.translation, along, u);
    vec3 arm = vec3_scale(motion->s - along, u);
    return (pose){quat_unit(quat_multiply(turn_rotation(&turn), tip.rotation)),
                  vec3_add(P, turn_apply(&turn, arm))};
}

// The rotation from a to b as axis · angle, the shorter way.
static vec3 turn_between(quat a, quat b) {
    quat d = quat_multiply(b, quat_conjugate(a));
    vec3 sine = {d.x, d.y, d.z};
    double length = vec3_length(sine), sign = d.w < 0 ? -1 : 1;
    double scale = length > 0 ? 2 * sign * atan2(length, sign * d.w) / length : 0;
    return vec3_scale(scale, sine);
}

// A rigid motion takes no point between two others farther than both.
double avatar_share(const struct avatar_extrapolation *extrapolation, pose sent, pose now) {
    vec3 end = {0, 0, -extrapolation->reach_mm};
    double longest = fmax(vec3_distance(now.translation, sent.translation),
                          vec3_distance(pose_apply(now, end), pose_apply(sent, end)));
    return longest > extrapolation->trust_radius_mm ? extrapolation->trust_radius_mm / longest : 1;
}

struct avatar_motion avatar_extrapolate(const struct avatar_extrapolation *extrapolation, pose sent,
                                        pose now) {
    double share = avatar_share(extrapolation, sent, now);
    vec3 way = vec3_sub(now.translation, sent.translation);
    vec3 turn = turn_between(sent.rotation, now.rotation);
    const double step[6] = {way.x, way.y, way.z, turn.x, turn.y, turn.z};
    double change[4] = {0};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 6; k++)
            change[i] += share * extrapolation->slope[i][k] * step[k];
    vec3 v = {change[0], change[1], change[2]};
    return (struct avatar_motion){vec3_add(extrapolation->motion.v, v),
                                  extrapolation->motion.s + change[3]};
}

// ---- frames -------------------------------------------------------------------------------------

static vec3 row_part(const double row[6], int from) {
    return (vec3){row[from], row[from + 1], row[from + 2]};
}

static void set_row_part(double row[6], int from, vec3 part) {
    row[from] = part.x;
    row[from + 1] = part.y;
    row[from + 2] = part.z;
}

// The slopes of v turn on both sides, those of s only over the hand's way.
struct avatar_extrapolation
avatar_extrapolation_in(pose T_a_b, const struct avatar_extrapolation *extrapolation) {
    struct avatar_extrapolation out = *extrapolation;
    mat3 R = quat_to_mat3(T_a_b.rotation);
    out.portal = pose_apply(T_a_b, extrapolation->portal);
    out.motion.v = mat3_apply(R, extrapolation->motion.v);
    for (int from = 0; from < 6; from += 3) {
        vec3 turned[3];
        for (int i = 0; i < 3; i++)
            turned[i] = mat3_apply(R, row_part(extrapolation->slope[i], from));
        for (int i = 0; i < 3; i++) {
            vec3 row = vec3_scale(R.m[i][0], turned[0]);
            row = vec3_add_scaled(row, R.m[i][1], turned[1]);
            set_row_part(out.slope[i], from, vec3_add_scaled(row, R.m[i][2], turned[2]));
        }
        set_row_part(out.slope[3], from, mat3_apply(R, row_part(extrapolation->slope[3], from)));
    }
    return out;
}
