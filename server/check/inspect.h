// Inspects a case without a session: structure, units, places.
#pragma once

#include "case/case.h"

enum finding_level { FINDING_NOTE, FINDING_WARNING, FINDING_FAULT };

struct check_finding {
    enum finding_level level;
    char where[CASE_NAME_MAX]; // group, portal or "joint"
    char text[384];
};

#define CHECK_FINDINGS_MAX 256

struct inspection {
    int count;
    int left_out;         // beyond CHECK_FINDINGS_MAX
    int faults, warnings; // of all, those left out too
    struct check_finding findings[CHECK_FINDINGS_MAX];
};

// Adds a finding, cut at the text's end.
void inspection_note(struct inspection *inspection, enum finding_level level, const char *where,
                     const char *format, ...) __attribute__((format(printf, 4, 5)));

// Faults: sizes and places beyond the bounds of check/anatomy.h, a tibia or femur that is not the
// size of a knee, a closed group that is inside out,
// a displacement of more than 30 mm, a portal off the skin or pointing away from the joint, bones
// or menisci that do not lie as the side and the frame (x right, y anterior, z proximal) say, a
// joint centre outside of the knee, an S'_max that is folded or sticks more than 0.5 mm out of its
// S', a surface that is folded a quarter, half or three quarters of the way from S' to it.
// Warnings: open or not manifold surfaces, unusual sizes and places, groups that a session could
// use but are not there, a cuttable group without a maxcut, an S'_max that sticks out by less, a
// plan of which a tenth or more may not go. Notes: the cut budget. The case must have passed
// case_validate.
void inspect_case(struct knee_case *knee, struct inspection *out_inspection);

// The largest length of a displacement, mm; 0 for NULL.
double inspect_largest(const struct case_group *group, const float *displacement);

// The greatest grade of a group's cartilage (case.h); 0: all is whole.
double inspect_worst_wear(const struct case_group *group);

// Origin of the joint frame in the femur's frame.
vec3 inspect_joint_centre(const struct knee_case *knee);

// A point on top of the medial tibial plateau, in the tibia's frame: above the middle (front to
// back) of the tibia's upper 15 mm, a quarter of its width to the medial side of the joint's
// centre. False where there is no surface below.
bool inspect_medial_plateau(struct knee_case *knee, vec3 *out_point);
