// Random numbers for tests and benches: the same on every machine for one seed (splitmix64).
#pragma once

#include "base/pose.h"

#include <math.h>
#include <stdint.h>

struct random {
    uint64_t state;
};

static inline uint64_t random_bits(struct random *r) {
    uint64_t z = (r->state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static inline double random_between(struct random *r, double low, double high) {
    return low + (high - low) * (double)(random_bits(r) >> 11) * 0x1p-53;
}

static inline vec3 random_in_box(struct random *r, double half) {
    double x = random_between(r, -half, half), y = random_between(r, -half, half);
    return (vec3){x, y, random_between(r, -half, half)};
}

static inline double random_normal(struct random *r) {
    double u = 1 - random_between(r, 0, 1);
    return sqrt(-2 * log(u)) * cos(6.283185307179586 * random_between(r, 0, 1));
}

static inline vec3 random_direction(struct random *r) {
    double x = random_normal(r), y = random_normal(r);
    return vec3_unit_or((vec3){x, y, random_normal(r)}, (vec3){1, 0, 0});
}

static inline pose random_pose(struct random *r, double half_mm) {
    vec3 axis = random_direction(r);
    quat q = quat_from_axis_angle(axis, random_between(r, -3.1, 3.1));
    return (pose){q, random_in_box(r, half_mm)};
}
