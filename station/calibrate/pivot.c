#include "calibrate/pivot.h"

#include "calibrate/eigen.h"

struct means {
    mat3 rotation;
    vec3 translation;
};

static struct means means_of(const pose *poses, int count) {
    struct means means = {0};
    for (int i = 0; i < count; i++) {
        means.rotation =
            mat3_add_scaled(means.rotation, 1.0 / count, quat_to_mat3(poses[i].rotation));
        means.translation = vec3_add_scaled(means.translation, 1.0 / count, poses[i].translation);
    }
    return means;
}

// Without q: (R_i − R̄) t = −(p_i − p̄), as normal equations A t = b.
static void normal_equations(const pose *poses, int count, const struct means *means,
                             double a[EIGEN_MAX][EIGEN_MAX], vec3 *out_b) {
    mat3 sum = {0};
    vec3 b = {0};
    for (int i = 0; i < count; i++) {
        mat3 d = mat3_add_scaled(quat_to_mat3(poses[i].rotation), -1, means->rotation);
        vec3 e = vec3_sub(poses[i].translation, means->translation);
        sum = mat3_add_scaled(sum, 1, mat3_multiply(mat3_transpose(d), d));
        b = vec3_sub(b, mat3_apply_transposed(d, e));
    }
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            a[row][column] = sum.m[row][column];
    *out_b = b;
}

static vec3 solve(const struct eigen *a, vec3 b) {
    vec3 t = {0};
    for (int k = 0; k < 3; k++) {
        vec3 v = {a->vectors[k][0], a->vectors[k][1], a->vectors[k][2]};
        t = vec3_add_scaled(t, vec3_dot(v, b) / a->values[k], v);
    }
    return t;
}

static void measure_pivot(const pose *poses, int count, struct pivot *out) {
    double sum = 0;
    out->max_mm = 0;
    for (int i = 0; i < count; i++) {
        double off = vec3_distance(pose_apply(poses[i], out->tip_mm), out->point_mm);
        sum += off * off;
        out->max_mm = fmax(out->max_mm, off);
    }
    out->rms_mm = sqrt(sum / count);
}

enum result pivot_calibrate(const pose *poses, int count, struct pivot *out, struct error *err) {
    if (count < PIVOT_POSES_MIN)
        return fail(err, RESULT_MISSING, "%d poses are too few, at least %d are needed", count,
                    PIVOT_POSES_MIN);
    struct means means = means_of(poses, count);
    double a[EIGEN_MAX][EIGEN_MAX] = {{0}};
    vec3 b;
    struct eigen eigen;
    normal_equations(poses, count, &means, a, &b);
    eigen_symmetric(3, a, &eigen);
    // Turning by small angles of mean squares α² >= β² >= γ² about three axes gives the eigenvalues
    // count · (α² + β², α² + γ², β² + γ²): along the first axis only β and γ tell where the tip is.
    double turn_deg = DEG_PER_RAD * sqrt(fmax(0, eigen.values[2]) / count);
    if (turn_deg < PIVOT_TURN_DEG)
        return fail(err, RESULT_INVALID,
                    "the tool turned only %.1f degrees about its second axis, less than %.0f. "
                    "Swing it wide, forward, back and sideways",
                    turn_deg, PIVOT_TURN_DEG);
    out->turn_deg = turn_deg;
    out->tip_mm = solve(&eigen, b);
    out->point_mm = vec3_add(mat3_apply(means.rotation, out->tip_mm), means.translation);
    measure_pivot(poses, count, out);
    return RESULT_OK;
}
