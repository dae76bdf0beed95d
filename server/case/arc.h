// A meniscus in plan, seen along the tibia: a C about a middle, with a way along from its anterior
// to its posterior end, a way inward from its outer margin, and heights.
#pragma once

#include "base/joint.h"
#include "base/result.h"
#include "mesh/mesh.h"

struct arc;

// Where a point lies. along and inward go on past the ends and margins.
struct arc_place {
    double along;  // share of the angle about the middle: 0 the anterior end, 1 the posterior one
    double inward; // mm from the outer margin towards the middle
    double height; // mm, along the tibia's z
};

// mesh: closed. T_mesh_joint: the tibia's joint frame (x right, y anterior, z proximal) in the
// mesh's. RESULT_INVALID where it is no C: nothing in the middle, one gap; or more than
// 200 mm wide. The caller destroys it.
enum result arc_create(const struct mesh *mesh, pose T_mesh_joint, struct arc **out_arc,
                       struct error *err);
void arc_destroy(struct arc **arc); // NULL inside is fine

struct arc_place arc_place(const struct arc *arc, vec3 p);           // p in the mesh's frame
vec3 arc_point(const struct arc *arc, struct arc_place place);       // its inverse
double arc_width(const struct arc *arc, double along);               // from margin to margin, mm
double arc_radius(const struct arc *arc, double along);              // of the outer margin, mm
double arc_angle(const struct arc *arc);                             // from end to end, radians
void arc_heights(const struct arc *arc, double along, double inward, // of the lower and the upper
                 double *out_lower, double *out_upper); // side; beside it, the nearest's
vec3 arc_outward(const struct arc *arc, double along);  // unit, in the mesh's frame
vec3 arc_up(const struct arc *arc);                     // unit, in the mesh's frame
