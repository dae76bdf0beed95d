// Pictures of sections through a joint.
#pragma once

#include "check/section.h"
#include "report/picture.h"

#define SECTION_SCALE 3 // pixels for each cell

// Free space by gain, from almost white (none) to almost black (`gain_most` and more); folds green.
// What is left out is hatched. Outlines: physical surfaces grey, where they are shown red; where
// facing surfaces are displaced into each other, blue and thick, where they only differ, light
// blue. The caller releases *out_picture.
void section_picture(const struct section *section, const struct case_check *check,
                     double gain_most, struct picture *out_picture);

// The colours from 0 to gain_most, left to right. The caller releases it.
void section_scale(struct picture *out_picture);
