// A knee with torn ligaments, without anatomy: keys in the joint's coordinates, in bone frames of
// any kind, and what a trainee sees of it.
#pragma once

#include "random.h"
#include "warp/adaptive.h"

enum { MCL, ACL, LCL, PLC };

struct torn {
    struct adaptive_setup setup;
    struct adaptive_key keys[ADAPTIVE_KEYS_MAX];
    pose rest[ADAPTIVE_KEYS_MAX];
    struct adaptive *adaptive;
};

struct joint_frame torn_joint(struct random *r); // some side, some frames

// Must not move in memory between start and build.
void torn_start(struct torn *knee, struct joint_frame joint);
void torn_add(struct torn *knee, int ligament, struct joint_angles physical,
              struct joint_angles target);
void torn_add_valgus(struct torn *knee, double flexion, double extra_deg); // to 6 degrees of valgus
void torn_add_drawer(struct torn *knee, double flexion, double extra_mm);  // to 6 mm of drawer
// As a tracker would record it: each motion brings something of all others.
void torn_add_recorded(struct torn *knee, struct random *r, int ligament, double flexion);
void torn_add_rest_path(struct torn *knee, int count); // 0 to 120 degrees of a coupled motion
void torn_build(struct torn *knee, enum adaptive_kind kind);
void torn_destroy(struct torn *knee);

// MCL: 10 degrees more of valgus, keys at 15, 45 and 65 degrees; ACL: 5 mm more of drawer, keys at
// 20 and 70.
void torn_create(struct torn *knee, struct random *r, bool mcl, bool acl);

pose torn_pose(const struct torn *knee, struct joint_angles angles); // the physical tibia
pose torn_seen(const struct torn *knee, pose T_femur_tibia);         // the virtual one
double torn_apart(const struct torn *knee, pose a, pose b); // mm, of points around the joint

// The virtual tibia's coordinates less the physical one's.
struct joint_angles torn_extra(const struct torn *knee, struct joint_angles angles);
double torn_extra_valgus(const struct torn *knee, double flexion, double valgus);
