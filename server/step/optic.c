#include "step/optic.h"

struct view_optic view_optic_usual(void) {
    return (struct view_optic){.tilt_deg = 30, .field_deg = 90};
}

bool view_optic_is_valid(const struct view_optic *optic) {
    return optic->tilt_deg >= 0 && optic->tilt_deg <= 90 && optic->field_deg >= 1 &&
           optic->field_deg <= 179;
}

vec3 optic_axis(const struct view_optic *optic, pose T_mockup_tip) {
    double tilt = optic->tilt_deg * RAD_PER_DEG;
    return quat_rotate(T_mockup_tip.rotation, (vec3){0, sin(tilt), cos(tilt)});
}
