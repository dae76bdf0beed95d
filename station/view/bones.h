// Where the bones are, by the rules of a server's step (PROTOCOL.md, "Bones"). All known values are
// the newest that were not lost: a bone that is lost stays where it was.
#pragma once

#include "base/joint.h"
#include "base/sample.h"

enum bone { BONE_FEMUR, BONE_TIBIA, BONE_PATELLA, BONE_COUNT }; // as arthron_Body

struct bones {
    bool has_knee; // false: a tibia or patella that is not tracked has no place
    struct knee_frame knee;
    bool joint_known, tracked[BONE_COUNT]; // there was ever a value
    enum validity joint_validity, tracked_validity[BONE_COUNT];
    struct joint_angles joint;
    pose T_mockup_tracked[BONE_COUNT];
};

struct bone_place {
    pose T_mockup_body;
    enum validity validity;
};

// A zeroed struct bones knows nothing.
void bones_take(struct bones *bones, const struct frame *frame);

// An untracked femur is the mock-up's own frame.
void bones_place(const struct bones *bones, struct bone_place out_places[BONE_COUNT]);
