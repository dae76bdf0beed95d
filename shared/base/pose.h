// Vectors, rotations and rigid motions (SE(3)) in double precision. Lengths are millimetres.
//
// A rigid motion is written T_a_b: it takes coordinates in frame b to coordinates in frame a,
// p_a = pose_apply(T_a_b, p_b), so that T_a_c = pose_compose(T_a_b, T_b_c).
// All functions are pure; none fails. Rotations are unit quaternions unless stated otherwise.
#pragma once

#include <math.h>
#include <stdbool.h>

#define DEG_PER_RAD 57.295779513082320876798
#define RAD_PER_DEG 0.017453292519943295769

typedef struct vec3 {
    double x, y, z;
} vec3;

typedef struct quat {
    double w, x, y, z;
} quat;

typedef struct mat3 {
    double m[3][3]; // m[row][column]
} mat3;

typedef struct pose {
    quat rotation;
    vec3 translation;
} pose;

// The generator of a rigid motion, a screw: the rotation is its axis times the angle in radians.
typedef struct twist {
    vec3 rotation, translation;
} twist;

static inline vec3 vec3_add(vec3 a, vec3 b) {
    return (vec3){a.x + b.x, a.y + b.y, a.z + b.z};
}

static inline vec3 vec3_sub(vec3 a, vec3 b) {
    return (vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}

static inline vec3 vec3_scale(double s, vec3 a) {
    return (vec3){s * a.x, s * a.y, s * a.z};
}

// a + s b
static inline vec3 vec3_add_scaled(vec3 a, double s, vec3 b) {
    return (vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}

static inline double vec3_dot(vec3 a, vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline vec3 vec3_cross(vec3 a, vec3 b) {
    return (vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static inline double vec3_length(vec3 a) {
    return sqrt(vec3_dot(a, a));
}

static inline double vec3_distance(vec3 a, vec3 b) {
    return vec3_length(vec3_sub(a, b));
}

static inline vec3 vec3_lerp(vec3 a, vec3 b, double t) {
    return vec3_add_scaled(vec3_scale(1 - t, a), t, b);
}

static inline bool vec3_is_finite(vec3 a) {
    return isfinite(a.x) && isfinite(a.y) && isfinite(a.z);
}

// a / |a|; `otherwise` where a has no length.
vec3 vec3_unit_or(vec3 a, vec3 otherwise);

static inline mat3 mat3_identity(void) {
    return (mat3){{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
}

static inline mat3 mat3_multiply(mat3 a, mat3 b) {
    mat3 c;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            c.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j] + a.m[i][2] * b.m[2][j];
    return c;
}

static inline mat3 mat3_transpose(mat3 a) {
    mat3 t;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            t.m[i][j] = a.m[j][i];
    return t;
}

// a bᵀ
static inline mat3 mat3_outer(vec3 a, vec3 b) {
    return (mat3){{{a.x * b.x, a.x * b.y, a.x * b.z},
                   {a.y * b.x, a.y * b.y, a.y * b.z},
                   {a.z * b.x, a.z * b.y, a.z * b.z}}};
}

// a + s b
static inline mat3 mat3_add_scaled(mat3 a, double s, mat3 b) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            a.m[i][j] += s * b.m[i][j];
    return a;
}

// a v
static inline vec3 mat3_apply(mat3 a, vec3 v) {
    return (vec3){a.m[0][0] * v.x + a.m[0][1] * v.y + a.m[0][2] * v.z,
                  a.m[1][0] * v.x + a.m[1][1] * v.y + a.m[1][2] * v.z,
                  a.m[2][0] * v.x + a.m[2][1] * v.y + a.m[2][2] * v.z};
}

// aᵀ v
static inline vec3 mat3_apply_transposed(mat3 a, vec3 v) {
    return (vec3){a.m[0][0] * v.x + a.m[1][0] * v.y + a.m[2][0] * v.z,
                  a.m[0][1] * v.x + a.m[1][1] * v.y + a.m[2][1] * v.z,
                  a.m[0][2] * v.x + a.m[1][2] * v.y + a.m[2][2] * v.z};
}

double mat3_determinant(mat3 a);
double mat3_norm(mat3 a); // largest singular value

quat quat_identity(void);

static inline quat quat_multiply(quat a, quat b) {
    return (quat){a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
                  a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                  a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
                  a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

static inline quat quat_conjugate(quat a) {
    return (quat){a.w, -a.x, -a.y, -a.z};
}

quat quat_unit(quat a); // the identity where a has no length
quat quat_from_axis_angle(vec3 unit_axis, double angle_rad);
quat quat_from_mat3(mat3 rotation); // rotation: orthonormal, right-handed

static inline mat3 quat_to_mat3(quat q) {
    double xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z;
    double xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z;
    double wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
    return (mat3){{{1 - 2 * (yy + zz), 2 * (xy - wz), 2 * (xz + wy)},
                   {2 * (xy + wz), 1 - 2 * (xx + zz), 2 * (yz - wx)},
                   {2 * (xz - wy), 2 * (yz + wx), 1 - 2 * (xx + yy)}}};
}

static inline vec3 quat_rotate(quat q, vec3 v) {
    vec3 u = {q.x, q.y, q.z};
    vec3 t = vec3_scale(2, vec3_cross(u, v));
    return vec3_add(vec3_add_scaled(v, q.w, t), vec3_cross(u, t));
}

double quat_angle(quat a, quat b);         // radians, 0 to pi, the shorter way round
quat quat_slerp(quat a, quat b, double t); // the shorter way round; extrapolates too

pose pose_identity(void);

pose pose_inverse(pose T_a_b); // T_b_a

// p_a
static inline vec3 pose_apply(pose T_a_b, vec3 p_b) {
    return vec3_add(quat_rotate(T_a_b.rotation, p_b), T_a_b.translation);
}

// p_b
static inline vec3 pose_apply_inverse(pose T_a_b, vec3 p_a) {
    return quat_rotate(quat_conjugate(T_a_b.rotation), vec3_sub(p_a, T_a_b.translation));
}

// T_a_c
static inline pose pose_compose(pose T_a_b, pose T_b_c) {
    return (pose){quat_multiply(T_a_b.rotation, T_b_c.rotation),
                  pose_apply(T_a_b, T_b_c.translation)};
}

pose pose_interpolate(pose a, pose b, double t); // straight in translation, slerp in rotation

pose pose_exp(twist t);
twist pose_log(pose p); // the inverse of pose_exp for angles below pi; the shorter way round

// Finite everywhere, rotation of unit length within 1e-3: what a sample from outside must be.
bool pose_is_valid(pose p);
