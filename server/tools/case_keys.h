// Keys of torn ligaments in clinical terms.
#pragma once

#include "case/case.h"

#include <jansson.h>

#define KEY_TEXT_MAX 160

// What takes the tibia from one pose to another in the joint's coordinates: "valgus 10.0 deg,
// drawer 6.9 mm". What is under 0.05 is left out; "nothing" where all is.
void key_motion_text(const struct joint_frame *joint, pose from, pose to, char out[KEY_TEXT_MAX]);

// "torn mcl  at 15.0 deg of flexion: held at valgus 5.0 deg; goes on by valgus 10.0 deg", a line.
void print_key(const struct knee_case *knee, int key);

// An object for each torn ligament, with its keys; flexion, and the joint's six values.
json_t *keys_array(const struct knee_case *knee);
