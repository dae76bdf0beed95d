#include "step/discrepancy.h"

#include <string.h>

#define STEP_MM 1e-3
#define POLAR_STEPS 12
#define SETTLED 1e-9

static vec3 shown_at(const struct avatar_extrapolation *extrapolation, pose tip, vec3 way) {
    pose now = {tip.rotation, vec3_add(tip.translation, way)};
    struct avatar_motion motion = avatar_extrapolate(extrapolation, tip, now);
    return avatar_place(extrapolation->mode, extrapolation->portal, &motion, now).translation;
}

// By central differences: exact for what is linear in the hand, and within 1e-7 for `rigid`.
static mat3 by_differences(const struct avatar_extrapolation *extrapolation, pose tip) {
    mat3 F;
    for (int axis = 0; axis < 3; axis++) {
        vec3 way = {axis == 0 ? STEP_MM : 0, axis == 1 ? STEP_MM : 0, axis == 2 ? STEP_MM : 0};
        vec3 ahead = shown_at(extrapolation, tip, way),
             behind = shown_at(extrapolation, tip, vec3_scale(-1, way));
        vec3 column = vec3_scale(0.5 / STEP_MM, vec3_sub(ahead, behind));
        F.m[0][axis] = column.x;
        F.m[1][axis] = column.y;
        F.m[2][axis] = column.z;
    }
    return F;
}

static mat3 slope_of(const struct avatar_extrapolation *extrapolation) {
    mat3 S = {0};
    for (int i = 0; extrapolation->trust_radius_mm > 0 && i < 3; i++)
        memcpy(S.m[i], extrapolation->slope[i], sizeof S.m[i]);
    return S;
}

static vec3 slide_of(const struct avatar_extrapolation *extrapolation) {
    const double *s = extrapolation->slope[3];
    return extrapolation->trust_radius_mm > 0 ? (vec3){s[0], s[1], s[2]} : (vec3){0, 0, 0};
}

// Of the tip at P + r w (base/extrapolation.h): u is the shaft, P = tip + a u the axis's point
// nearest to the portal with a = u·(portal − tip), w = (u + v)/|u + v| with v across u, r = s − a:
//     F = I − u uᵀ + w (∇s + u)ᵀ + r (I − w wᵀ)(I − u uᵀ) ∇v / |u + v|
static mat3 rigid_by_derivative(const struct avatar_extrapolation *extrapolation, pose tip) {
    vec3 u = quat_rotate(tip.rotation, (vec3){0, 0, 1}), v = extrapolation->motion.v;
    mat3 I = mat3_identity(), across = mat3_add_scaled(I, -1, mat3_outer(u, u));
    vec3 turned = vec3_add(u, mat3_apply(across, v));
    double length = vec3_length(turned);
    vec3 w = vec3_scale(1 / length, turned);
    double r =
        extrapolation->motion.s - vec3_dot(u, vec3_sub(extrapolation->portal, tip.translation));
    mat3 swing = mat3_multiply(mat3_add_scaled(I, -1, mat3_outer(w, w)),
                               mat3_multiply(across, slope_of(extrapolation)));
    mat3 slide = mat3_outer(w, vec3_add(slide_of(extrapolation), u));
    return mat3_add_scaled(mat3_add_scaled(across, 1, slide), r / length, swing);
}

static mat3 by_derivative(const struct avatar_extrapolation *extrapolation, pose tip) {
    if (extrapolation->mode == AVATAR_RIGID)
        return rigid_by_derivative(extrapolation, tip);
    return mat3_add_scaled(mat3_identity(), 1, slope_of(extrapolation));
}

// The largest singular value is known, so that the other two are from their sum of squares and
// their product.
static double least_gain(mat3 F, double most, double determinant) {
    double squares = 0;
    for (int i = 0; i < 9; i++)
        squares += F.m[i / 3][i % 3] * F.m[i / 3][i % 3];
    if (!(most > 0))
        return 0;
    double two = fmax(squares - most * most, 0), twice = 2 * fabs(determinant) / most;
    double least = 0.5 * (sqrt(two + twice) - sqrt(fmax(two - twice, 0)));
    return determinant < 0 ? -least : least;
}

// det(F) F⁻ᵀ
static mat3 cofactors(mat3 F) {
    mat3 c;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            c.m[i][k] = F.m[i1][k1] * F.m[i2][k2] - F.m[i1][k2] * F.m[i2][k1];
        }
    return c;
}

static double largest_difference(mat3 a, mat3 b) {
    double largest = 0;
    for (int i = 0; i < 9; i++)
        largest = fmax(largest, fabs(a.m[i / 3][i % 3] - b.m[i / 3][i % 3]));
    return largest;
}

// The angle of the rotation R nearest to F: R ← (R + R⁻ᵀ)/2 (Higham, SIAM J. Sci. Stat. Comput. 7,
// 1986). Once a step is small, the next one would be its square. `settled` 0: all steps.
static double turn_of(mat3 F, double settled) {
    mat3 R = F, before, zero = {0};
    int step = 0;
    do {
        double determinant = mat3_determinant(R);
        if (!(determinant > 1e-6))
            return 180;
        before = R;
        mat3 half = mat3_add_scaled(zero, 0.5, R);
        R = mat3_add_scaled(half, 0.5 / determinant, cofactors(R));
    } while (++step < POLAR_STEPS && !(largest_difference(R, before) < settled));
    vec3 axis = {R.m[2][1] - R.m[1][2], R.m[0][2] - R.m[2][0], R.m[1][0] - R.m[0][1]};
    double trace = R.m[0][0] + R.m[1][1] + R.m[2][2];
    return DEG_PER_RAD * atan2(vec3_length(axis), trace - 1);
}

struct discrepancy discrepancy_of(const struct avatar_extrapolation *extrapolation, pose tip,
                                  pose shown, bool differences) {
    mat3 F = differences ? by_differences(extrapolation, tip) : by_derivative(extrapolation, tip);
    struct discrepancy d = {
        .offset_mm = vec3_distance(shown.translation, tip.translation),
        .tilt_deg = DEG_PER_RAD * quat_angle(tip.rotation, shown.rotation),
        .gain = mat3_norm(F),
        .turn_deg = turn_of(F, differences ? 0 : SETTLED),
    };
    d.gain_least = least_gain(F, d.gain, mat3_determinant(F));
    return d;
}

bool discrepancy_is_noticed(const struct discrepancy *d) {
    return d->turn_deg > NOTICED_TURN_DEG || d->tilt_deg > NOTICED_TURN_DEG ||
           d->gain > NOTICED_GAIN_MOST || d->gain_least < NOTICED_GAIN_LEAST;
}
