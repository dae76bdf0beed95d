// Keys of torn ligaments as a technician records them on the mock-up: with its ligaments mounted
// the joint is pushed to its end (the physical pose), once for each flexion; with the ligament off
// it is pushed on (the target), at about the same flexions. Physical poses wait for their targets
// in a file beside the case, recorded.json, which is no part of it:
//
//     { "format": 1,
//       "physical": [ { "ligament": "mcl", "T_femur_tibia": [x, y, z, qw, qx, qy, qz] }, … ] }
#pragma once

#include "case/case.h"

#define RECORD_SAME_DEG 1.0 // of flexion: what is recorded as near as this replaces what was there
#define RECORD_PAIR_DEG 5.0 // a target belongs to a physical pose as near as this

#define RECORD_ON_DEG 1.0 // a target goes on from it by so much or more, or
#define RECORD_ON_MM 1.0

struct record {
    int count;
    struct {
        char ligament[CASE_NAME_MAX];
        pose physical;
    } waiting[CASE_KEYS_MAX];
};

// Bounds-checked; nothing waits where there is no file. The error names file and key.
enum result record_load(const char *dir, struct record *out_record, struct error *err);
// The file goes where nothing waits.
enum result record_save(const char *dir, const struct record *record, struct error *err);

// All three take a valid T_femur_tibia. RESULT_LIMIT: too many of them; RESULT_INVALID: a bad name.

// The rest path gets this pose, by rising flexion.
enum result record_rest(struct knee_case *knee, pose T_femur_tibia, struct error *err);
enum result record_physical(const struct knee_case *knee, struct record *record,
                            const char *ligament, pose T_femur_tibia, struct error *err);
// Completes the nearest of the ligament's waiting poses to a key, or else gives the nearest of its
// keys another target; RESULT_MISSING where there is neither, RESULT_INVALID where the joint has
// not gone on from it. *out_key: its index.
enum result record_target(struct knee_case *knee, struct record *record, const char *ligament,
                          pose T_femur_tibia, int *out_key, struct error *err);
