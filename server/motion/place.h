// Where the places that a script names lie on a case.
#pragma once

#include "motion/motion.h"

// Proposes all landmarks (landmarks/landmarks.h) where one that the script names is not there, and
// portals where there are none. The case in memory gets them.
enum result place_prepare(struct knee_case *knee, const struct motion_script *script,
                          struct error *err);

// In the rest pose, where the frames of all bodies coincide. RESULT_MISSING: no such landmark.
enum result place_find(const struct knee_case *knee, const struct motion_place *place,
                       vec3 *out_point, struct error *err);

#define PLACE_NAME_MAX (CASE_NAME_MAX + 64)

// As an error names it: "plateau_medial", or "-20.0 4.0 -22.0" for a point.
const char *place_name(const struct motion_place *place, char out_text[PLACE_NAME_MAX]);
