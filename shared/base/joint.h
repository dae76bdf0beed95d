// The knee joint in the coordinates of Grood and Suntay (J. Biomech. Eng. 105, 1983):
// flexion about the femur's medio-lateral axis e1, internal rotation about the tibia's long axis
// e3, varus about the floating axis e2 = e3 × e1, and a translation along the same three axes.
//
// Joint frames of both bones: x to the right of the patient, y anterior, z proximal. In the rest
// pose (all six values 0) the two joint frames coincide.
#pragma once

#include "base/pose.h"

enum side { SIDE_RIGHT, SIDE_LEFT };

struct joint_angles {
    double flexion_deg;    // the tibia bends backward
    double varus_deg;      // the distal tibia towards the midline; valgus is negative
    double internal_deg;   // the front of the tibia turns towards the midline
    double shift_mm;       // the tibia towards lateral, along e1
    double drawer_mm;      // the tibia forward, along e2
    double distraction_mm; // the tibia away from the femur, along -e3
};

// Each value straight between a (t = 0) and b (t = 1).
struct joint_angles joint_interpolate(const struct joint_angles *a, const struct joint_angles *b,
                                      double t);

// Where the joint frames lie in the frames of the two bones.
struct joint_frame {
    enum side side;
    pose T_femur_joint;
    pose T_tibia_joint;
};

// Pose of the tibia in the femur's frame, T_femur_tibia.
pose joint_to_pose(const struct joint_frame *frame, const struct joint_angles *angles);

// The inverse of joint_to_pose. Unique for |varus| < 90 degrees; at 90 degrees the axes e1 and e3
// coincide and the internal rotation is put to 0.
struct joint_angles joint_from_pose(const struct joint_frame *frame, pose T_femur_tibia);

// Where the patella is over flexion when nothing tracks it.
struct patella_key {
    double flexion_deg;
    pose T_femur_patella;
};

#define PATELLA_KEYS_MAX 64

// T_femur_patella between the keys, whose flexion rises: straight in translation, slerp in
// rotation; constant past the outer ones, the identity where there is none.
pose patella_pose(const struct patella_key *keys, int count, double flexion_deg);

// How the bones of a knee hang together.
struct knee_frame {
    struct joint_frame joint;
    int patella_count;
    struct patella_key patella[PATELLA_KEYS_MAX];
};
