#include "base/pose.h"

vec3 vec3_unit_or(vec3 a, vec3 otherwise) {
    double length = vec3_length(a);
    return length > 0 ? vec3_scale(1 / length, a) : otherwise;
}

double mat3_determinant(mat3 a) {
    return a.m[0][0] * (a.m[1][1] * a.m[2][2] - a.m[1][2] * a.m[2][1]) -
           a.m[0][1] * (a.m[1][0] * a.m[2][2] - a.m[1][2] * a.m[2][0]) +
           a.m[0][2] * (a.m[1][0] * a.m[2][1] - a.m[1][1] * a.m[2][0]);
}

// The largest eigenvalue of aᵀa in closed form (trigonometric solution of the cubic).
double mat3_norm(mat3 a) {
    mat3 s = mat3_multiply(mat3_transpose(a), a);
    double mean = (s.m[0][0] + s.m[1][1] + s.m[2][2]) / 3;
    mat3 d = mat3_add_scaled(s, -mean, mat3_identity());
    double sum = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            sum += d.m[i][j] * d.m[i][j];
    double spread = sqrt(sum / 6);
    if (spread <= 1e-300)
        return sqrt(fmax(mean, 0));
    double r = mat3_determinant(d) / (2 * spread * spread * spread);
    double angle = acos(fmax(-1, fmin(1, r))) / 3;
    return sqrt(fmax(mean + 2 * spread * cos(angle), 0));
}

quat quat_identity(void) {
    return (quat){1, 0, 0, 0};
}

static double quat_dot(quat a, quat b) {
    return a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z;
}

quat quat_unit(quat a) {
    double length = sqrt(quat_dot(a, a));
    if (!(length > 0))
        return quat_identity();
    return (quat){a.w / length, a.x / length, a.y / length, a.z / length};
}

quat quat_from_axis_angle(vec3 unit_axis, double angle_rad) {
    double s = sin(angle_rad / 2);
    return (quat){cos(angle_rad / 2), s * unit_axis.x, s * unit_axis.y, s * unit_axis.z};
}

// Shepperd's method: divide by the largest component.
quat quat_from_mat3(mat3 r) {
    double trace = r.m[0][0] + r.m[1][1] + r.m[2][2];
    quat q;
    if (trace > 0) {
        q = (quat){1 + trace, r.m[2][1] - r.m[1][2], r.m[0][2] - r.m[2][0], r.m[1][0] - r.m[0][1]};
    } else if (r.m[0][0] >= r.m[1][1] && r.m[0][0] >= r.m[2][2]) {
        q = (quat){r.m[2][1] - r.m[1][2], 1 + r.m[0][0] - r.m[1][1] - r.m[2][2],
                   r.m[0][1] + r.m[1][0], r.m[0][2] + r.m[2][0]};
    } else if (r.m[1][1] >= r.m[2][2]) {
        q = (quat){r.m[0][2] - r.m[2][0], r.m[0][1] + r.m[1][0],
                   1 - r.m[0][0] + r.m[1][1] - r.m[2][2], r.m[1][2] + r.m[2][1]};
    } else {
        q = (quat){r.m[1][0] - r.m[0][1], r.m[0][2] + r.m[2][0], r.m[1][2] + r.m[2][1],
                   1 - r.m[0][0] - r.m[1][1] + r.m[2][2]};
    }
    return quat_unit(q);
}

double quat_angle(quat a, quat b) {
    quat d = quat_multiply(quat_conjugate(a), b);
    return 2 * atan2(sqrt(d.x * d.x + d.y * d.y + d.z * d.z), fabs(d.w));
}

quat quat_slerp(quat a, quat b, double t) {
    quat d = quat_multiply(quat_conjugate(a), b);
    if (d.w < 0)
        d = (quat){-d.w, -d.x, -d.y, -d.z};
    double sine = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    double angle = 2 * atan2(sine, d.w);
    if (sine < 1e-12)
        return a;
    vec3 axis = {d.x / sine, d.y / sine, d.z / sine};
    return quat_unit(quat_multiply(a, quat_from_axis_angle(axis, t * angle)));
}

pose pose_identity(void) {
    return (pose){{1, 0, 0, 0}, {0, 0, 0}};
}

pose pose_inverse(pose T_a_b) {
    quat inverse = quat_conjugate(T_a_b.rotation);
    return (pose){inverse, vec3_scale(-1, quat_rotate(inverse, T_a_b.translation))};
}

pose pose_interpolate(pose a, pose b, double t) {
    return (pose){quat_slerp(a.rotation, b.rotation, t),
                  vec3_lerp(a.translation, b.translation, t)};
}

// exp: t = V u with V = I + a [w] + b [w]², a = (1 − cos θ)/θ², b = (θ − sin θ)/θ³, θ = |w|.
pose pose_exp(twist t) {
    vec3 w = t.rotation, u = t.translation;
    double angle = vec3_length(w), half = angle / 2;
    bool tiny = angle < 1e-4; // where the next terms are below the rounding
    double sinc = tiny ? 1 - half * half / 6 : sin(half) / half;
    double b = tiny ? 1.0 / 6 : (angle - sin(angle)) / (angle * angle * angle);
    vec3 wu = vec3_cross(w, u);
    quat rotation = {cos(half), sinc / 2 * w.x, sinc / 2 * w.y, sinc / 2 * w.z};
    return (pose){rotation,
                  vec3_add_scaled(vec3_add_scaled(u, sinc * sinc / 2, wu), b, vec3_cross(w, wu))};
}

// V⁻¹ = I − [w]/2 + c [w]², c = (1 − (θ/2) cot(θ/2))/θ².
twist pose_log(pose p) {
    quat q = p.rotation.w < 0 ? (quat){-p.rotation.w, -p.rotation.x, -p.rotation.y, -p.rotation.z}
                              : p.rotation;
    vec3 v = {q.x, q.y, q.z};
    double sine = vec3_length(v), half = atan2(sine, q.w), angle = 2 * half;
    bool tiny = angle < 1e-4;
    vec3 w = vec3_scale(tiny ? 2 / q.w : angle / sine, v);
    double c = tiny ? 1.0 / 12 : (1 - half * q.w / sine) / (angle * angle);
    vec3 wt = vec3_cross(w, p.translation);
    vec3 u = vec3_add_scaled(p.translation, -0.5, wt);
    return (twist){w, vec3_add_scaled(u, c, vec3_cross(w, wt))};
}

bool pose_is_valid(pose p) {
    double length = sqrt(quat_dot(p.rotation, p.rotation));
    return vec3_is_finite(p.translation) && isfinite(length) && fabs(length - 1) < 1e-3;
}
