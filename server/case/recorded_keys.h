// Keys of torn ligaments as a technician records them on the mock-up: with its ligaments mounted
// the joint is pushed to its end (the physical pose), once for each flexion; with the ligament off
// it is pushed on (the target), at about the same flexions. Physical poses wait for their targets
// in a file beside the case, recorded.json, which is no part of it:
//
//     { "format": 1,
//       "physical": [ { "ligament": "mcl", "T_femur_tibia": [x, y, z, qw, qx, qy, qz] }, … ] }
#pragma once

#include "case/case.h"

#define RECORDED_SAME_DEG 1.0 // of flexion: a recording replaces an older one within this
#define RECORDED_PAIR_DEG 5.0 // of flexion: a target belongs to a physical pose within this

#define RECORDED_ON_DEG 1.0 // a target must be at least this far from its physical pose, or
#define RECORDED_ON_MM 1.0

struct recorded_keys {
    int count;
    struct {
        char ligament[CASE_NAME_MAX];
        pose physical;
    } waiting[CASE_KEYS_MAX];
};

// Reads the waiting poses with checks of their bounds; none if there is no file. The error names
// file and key.
enum result recorded_keys_load(const char *dir, struct recorded_keys *out_record,
                               struct error *err);
// Removes the file if no pose waits.
enum result recorded_keys_save(const char *dir, const struct recorded_keys *record,
                               struct error *err);

// All three take a valid T_femur_tibia. RESULT_LIMIT: too many of them; RESULT_INVALID: a bad name.

// Adds this pose to the rest path, which rises in flexion.
enum result recorded_keys_rest(struct knee_case *knee, pose T_femur_tibia, struct error *err);
enum result recorded_keys_physical(const struct knee_case *knee, struct recorded_keys *record,
                                   const char *ligament, pose T_femur_tibia, struct error *err);
// Makes a key of the ligament's nearest waiting pose and this target, or else gives its nearest key
// this target. RESULT_MISSING: there is neither. RESULT_INVALID: the joint is not further than in
// the physical pose. *out_key: index of the key.
enum result recorded_keys_target(struct knee_case *knee, struct recorded_keys *record,
                                 const char *ligament, pose T_femur_tibia, int *out_key,
                                 struct error *err);
