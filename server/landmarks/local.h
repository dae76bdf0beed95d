// A knee in local coordinates, the same for a left knee and its mirror image: x lateral, y
// anterior, z proximal, the origin in the joint. All bodies, in the rest pose.
#pragma once

#include "case/case.h"

struct local {
    pose T_femur_local; // of the right knee that the mirror shows
    bool is_mirrored;
};

struct local local_of(const struct knee_case *knee); // as the case's joint frame lies
vec3 to_local(const struct local *local, vec3 p);    // p: rest pose, femur's frame
vec3 from_local(const struct local *local, vec3 p);

// The same knee seen from another frame: T_local_new in these local coordinates.
struct local local_turned(const struct local *local, pose T_local_new);
pose local_joint(const struct local *local); // T_femur_joint of a joint that lies there

// The vertices in local coordinates; the caller frees them.
vec3 *local_points(const struct local *local, const struct mesh *mesh);
