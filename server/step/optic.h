// The scope's optic: the direction and the angle of its view. No step uses it, but the metrics of a
// session do (metrics/view.h), so its trace stores it.
#pragma once

#include "base/pose.h"

#include <stdbool.h>

struct view_optic {
    double tilt_deg;  // 0 to 90; 30 or 70 is usual
    double field_deg; // the cone's whole angle, 1 to 179
};

struct view_optic view_optic_usual(void); // 30 degrees, and a field of 90
bool view_optic_is_valid(const struct view_optic *optic);

// Where the optic looks, a unit vector: tilted from the shaft towards the y axis of the tip's
// frame.
vec3 optic_axis(const struct view_optic *optic, pose T_mockup_tip);
