#include "calibrate/landmarks.h"

#include "calibrate/eigen.h"

static vec3 mean_point(const vec3 *points, int count) {
    vec3 mean = {0};
    for (int i = 0; i < count; i++)
        mean = vec3_add_scaled(mean, 1.0 / count, points[i]);
    return mean;
}

// Σ (a_i − ā)(b_i − b̄)ᵀ
static mat3 covariance(const vec3 *a, const vec3 *b, int count) {
    vec3 mean_a = mean_point(a, count), mean_b = mean_point(b, count);
    mat3 sum = {0};
    for (int i = 0; i < count; i++)
        sum = mat3_add_scaled(sum, 1, mat3_outer(vec3_sub(a[i], mean_a), vec3_sub(b[i], mean_b)));
    return sum;
}

// Root mean square of the distances from the line that fits best.
static double distance_from_line(const vec3 *points, int count) {
    mat3 scatter = covariance(points, points, count);
    double a[EIGEN_MAX][EIGEN_MAX] = {{0}};
    struct eigen eigen;
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            a[row][column] = scatter.m[row][column];
    eigen_symmetric(3, a, &eigen);
    return sqrt(fmax(0, eigen.values[1] + eigen.values[2]) / count);
}

// Horn's matrix: the unit quaternion that maximises qᵀNq turns b onto a.
static quat best_rotation(const vec3 *in_a, const vec3 *in_b, int count) {
    mat3 c = covariance(in_b, in_a, count); // Horn's S: from b (left) to a (right)
    double xx = c.m[0][0], xy = c.m[0][1], xz = c.m[0][2];
    double yx = c.m[1][0], yy = c.m[1][1], yz = c.m[1][2];
    double zx = c.m[2][0], zy = c.m[2][1], zz = c.m[2][2];
    const double n[EIGEN_MAX][EIGEN_MAX] = {
        {xx + yy + zz, yz - zy, zx - xz, xy - yx},
        {yz - zy, xx - yy - zz, xy + yx, zx + xz},
        {zx - xz, xy + yx, yy - xx - zz, yz + zy},
        {xy - yx, zx + xz, yz + zy, zz - xx - yy},
    };
    struct eigen eigen;
    eigen_symmetric(4, n, &eigen);
    const double *q = eigen.vectors[0];
    return quat_unit((quat){q[0], q[1], q[2], q[3]});
}

enum result landmarks_register(const vec3 *in_a, const vec3 *in_b, int count,
                               struct registration *out, double *out_residuals_mm,
                               struct error *err) {
    if (count < LANDMARKS_MIN)
        return fail(err, RESULT_MISSING, "%d landmarks are too few, at least %d are needed", count,
                    LANDMARKS_MIN);
    double spread = fmin(distance_from_line(in_a, count), distance_from_line(in_b, count));
    if (spread < LANDMARKS_SPREAD_MM)
        return fail(
            err, RESULT_INVALID,
            "the landmarks lie within %.1f mm of a straight line, less than %.0f. Choose others",
            spread, LANDMARKS_SPREAD_MM);
    quat rotation = best_rotation(in_a, in_b, count);
    vec3 turned = quat_rotate(rotation, mean_point(in_b, count));
    out->T_a_b = (pose){rotation, vec3_sub(mean_point(in_a, count), turned)};
    double sum = 0;
    out->max_mm = 0;
    for (int i = 0; i < count; i++) {
        out_residuals_mm[i] = vec3_distance(pose_apply(out->T_a_b, in_b[i]), in_a[i]);
        sum += out_residuals_mm[i] * out_residuals_mm[i];
        out->max_mm = fmax(out->max_mm, out_residuals_mm[i]);
    }
    out->rms_mm = sqrt(sum / count);
    return RESULT_OK;
}
