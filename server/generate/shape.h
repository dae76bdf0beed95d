// The solids of a right knee of size 1 in extension, in the femur's frame: x lateral, y anterior,
// z proximal, the origin on the flexion axis (x) midway between the condyles. Millimetres.
//
// The condyles are barrels round the flexion axis, so that femur and tibia touch alike (but for
// SHAPE_CONTACT_GAP) at every flexion from 0 to 120 degrees.
#pragma once

#include "generate/implicit.h"

#define SHAPE_CONTACT_GAP 0.4   // between femur and tibia under each condyle
#define SHAPE_CONDYLE_X 21.5    // a condyle's ridge, lateral and medial
#define SHAPE_CONDYLE_RADIUS 22 // about the flexion axis
#define SHAPE_FLEXION_MAX 120

double shape_femur(vec3 p);
double shape_tibia(vec3 p); // with the head of the fibula
double shape_patella(vec3 p);
double shape_skin(vec3 p);

struct box shape_femur_box(void);
struct box shape_tibia_box(void);
struct box shape_patella_box(void);
struct box shape_skin_box(void);

// The patella turns about the trochlea's axis as the knee flexes, at the distance where it just
// clears the femur by `gap` with every vertex of its mesh.
pose shape_patella_pose(const struct mesh *patella, double flexion_deg, double gap);

// Whether the femur comes as near as `gap` to a point of the tibia between extension and full
// flexion.
bool shape_femur_sweeps(vec3 p_tibia, double gap);

// The height of the tibia's upper surface at (x, y).
double shape_plateau(double x, double y);

// From 0 at `low` smoothly to 1 at `high`.
double shape_ramp(double low, double high, double x);
