// The scope's optic: where it looks, and how much it sees. No step asks for it; the figures of a
// session do (metrics/view.h), so a session's record has it.
#pragma once

#include <stdbool.h>

struct view_optic {
    double tilt_deg;  // 0 to 90; 30 or 70 is usual
    double field_deg; // the cone's whole angle, 1 to 179
};

struct view_optic view_optic_usual(void); // 30 degrees, and a field of 90
bool view_optic_is_valid(const struct view_optic *optic);
