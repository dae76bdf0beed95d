// Extrapolation of an avatar's motion between two answers of the server, so that the network is not
// between hand and eye (docs/ARCHITECTURE.md). An answer has the avatar's displacement and its
// derivative over the hand's motion. The viewer applies both to the newest pose.
//
// The tip's frame has its origin in the tip and z along the shaft, away from the handle. `rigid`
// turns and slides the instrument in its portal: with u along the axis, P the axis's point nearest
// to the portal, and Q the shortest turn of u into (u + v)/|u + v|, a point P + a goes to
// P + Q (a + s u). The other modes displace all points by v. Millimetres and radians.
#pragma once

#include "base/pose.h"

enum avatar_mode {
    AVATAR_TIP,    // all of it moves as its tip does
    AVATAR_POINTS, // all of it moves by a mean over its points
    AVATAR_RIGID,  // it turns and slides in its portal
    AVATAR_MODE_COUNT
};

const char *avatar_mode_name(enum avatar_mode mode); // "tip", "points", "rigid"
bool avatar_mode_from_name(const char *name, enum avatar_mode *out_mode);

// How the avatar moves.
struct avatar_motion {
    vec3 v;   // rigid: v, a part of 1; else the displacement of every point, mm
    double s; // rigid: s, mm; else 0
};

// All in one frame: the world, or a body's.
struct avatar_extrapolation {
    enum avatar_mode mode;
    vec3 portal; // of `rigid`
    struct avatar_motion motion;
    double slope[4][6]; // of v.x, v.y, v.z, s over the hand's way: along x, y, z, mm; and its turn
                        // about the tip, around x, y, z, radians
    double reach_mm;    // how far the body goes from its tip, towards the handle; of `tip` 0
    double trust_radius_mm; // how far any point may have moved for motion + slope · way to be used
};

// The motion at a tip's pose, in the motion's frame.
pose avatar_place(enum avatar_mode mode, vec3 portal, const struct avatar_motion *motion, pose tip);

// How much of the way from `sent` to `now` counts: all, 1, or as much as brings no point of the
// body farther than the trust radius.
double avatar_share(const struct avatar_extrapolation *extrapolation, pose sent, pose now);

// The motion once the hand has gone on from `sent` to `now`: motion + share · slope · way.
struct avatar_motion avatar_extrapolate(const struct avatar_extrapolation *extrapolation, pose sent,
                                        pose now);

// The same extrapolation in frame a, given in frame b.
struct avatar_extrapolation
avatar_extrapolation_in(pose T_a_b, const struct avatar_extrapolation *extrapolation);
