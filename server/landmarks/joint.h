// The posterior condyles and what follows from them, in local coordinates.
#pragma once

#include "landmarks/landmarks.h"
#include "landmarks/profile.h"

struct condyles {
    struct local local; // its x axis is the flexion axis, its origin midway
    double ridge_x[COMPARTMENT_COUNT];
    struct condyle_fit fits[COMPARTMENT_COUNT]; // centre: in these local coordinates
    struct profile femur;                       // unrolled about the flexion axis
};

// As landmarks_fit_joint. The caller releases it with condyles_fini, after an error too.
enum result condyles_fit(struct condyles *condyles, struct knee_case *knee, struct error *err);
void condyles_fini(struct condyles *condyles);
