// Whether a case's landmarks are where their names say.
#pragma once

#include "check/inspect.h"
#include "check/touch.h"

// How far each landmark of the case lies off the surface that it names, out of it if it may lie
// inside; NAN: of another body, of a group that is not there, or of an unknown name. Millimetres.
// touching: of each group.
void landmarks_look(const struct knee_case *knee, const struct touching *touching,
                    double out_off_mm[CASE_LANDMARKS_MAX]);

// Faults: another body than the name's, the wrong side of the joint, places in the wrong order,
// LANDMARK_FAR_MM more off the surface than a landmark of this name and its error may be. Less of
// that: a warning.
#define LANDMARK_FAR_MM 10.0
void landmarks_inspect(const struct knee_case *knee, const double *off_mm,
                       struct inspection *inspection);
