// The shortest turn of one direction into another, and its first and second derivatives. For
// extrapolation.c and the fit of an avatar.
#pragma once

#include "base/pose.h"

// Q turns u into (u + v)/|u + v|, where v = v[0] e[0] + v[1] e[1] and e[0], e[1], u are
// orthonormal:
//
//     Q x = x + c k×x + g k×(k×x),  k = u×v,  c = 1/√(1 + |v|²),  g = c²/(1 + c)
struct turn {
    vec3 axes[2]; // ∂k/∂v
    vec3 k;
    double c, c1[2], c2[3]; // and its derivatives: 0, 1; 00, 01, 11
    double g, g1[2], g2[3];
};

struct turn turn_into(vec3 u, const vec3 e[2], const double v[2]);
vec3 turn_apply(const struct turn *turn, vec3 x);
quat turn_rotation(const struct turn *turn);

// ∂(Q x)/∂v, and the second derivatives 00, 01, 11.
void turn_slopes(const struct turn *turn, vec3 x, vec3 out_first[2], vec3 out_second[3]);
