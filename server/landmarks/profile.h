// The outermost surface of a bone, as heights over a lattice.
#pragma once

#include "landmarks/local.h"
#include "mesh/columns.h"

struct profile {
    struct columns columns;
};

// The femur unrolled about the local x axis: how far its outermost surface is from the axis, over x
// and the angle from distal (0) by posterior (90) or anterior (-90). The caller releases it.
void profile_unroll(struct profile *profile, const struct local *local, const struct mesh *femur);

// How high the upper surface of the tibia's upper 30 mm lies, over x and y.
void profile_top(struct profile *profile, const struct local *local, const struct mesh *tibia);

// How low the lower surface of the femur lies, over x and y: its height is counted downwards.
void profile_bottom(struct profile *profile, const struct local *local, const struct mesh *femur);
void profile_fini(struct profile *profile);

double profile_radius(const struct profile *profile, double x, double angle_deg); // NAN: none
double profile_height(const struct profile *profile, double x, double y);         // NAN: none

vec3 profile_place(double x, double angle_deg, double radius); // in local coordinates
