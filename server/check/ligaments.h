// The effect of a case's torn ligaments on its joint.
#pragma once

#include "step/session.h"

#define OPENING_STEPS 61 // 0 to 120 degrees of flexion, every 2

// One key pose, by the bones alone.
struct key_figures {
    double physical_mm; // how deep the mock-up's tibia is in the femur
    double virtual_mm;  // the same of the virtual tibia
    vec3 place;         // of the latter, in the femur's frame
};

struct key_figures ligaments_key(const struct scene *scene, enum adaptive_kind kind, int key);

// The largest displacement of a point of the tibia near the joint (57 mm from its centre) in the
// rest pose, 0 to 120 degrees in steps of 0.5, mm.
double ligaments_rest_mm(const struct scene *scene, enum adaptive_kind kind);

// The gain of a torn ligament: mm that the shown tibia goes further for each mm that the mock-up's
// is moved from rest to a key, at most, by points of the tibia near the joint (57 mm from its
// centre).
double ligaments_gain(const struct scene *scene, enum adaptive_kind kind, int key);

// The joint with a ligament held against its end, over flexion: straight between its keys, constant
// past them.
struct joint_angles ligaments_held(const struct knee_case *knee, int ligament, double flexion_deg);

// A ligament's extra motion over flexion, in the joint coordinate that its targets change most.
struct opening {
    const char *coordinate; // "valgus", "drawer", ...
    const char *unit;       // "degrees", "mm"
    double flexion[OPENING_STEPS], physical[OPENING_STEPS], shown[OPENING_STEPS];
    int key_count;
    double key_flexion[CASE_KEYS_MAX], key_target[CASE_KEYS_MAX];
};

void ligaments_opening(const struct scene *scene, enum adaptive_kind kind, int ligament,
                       struct opening *out_opening);
