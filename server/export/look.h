// How the parts of a session look in scenes that other programs show.
#pragma once

#include "case/case.h"
#include "step/settings.h"

// Four values, 0 to 1: of what the case and the session describe; the skin is translucent, and an
// instrument without a colour of its own is steel.
void look_of_group(const struct case_group *group, float out_rgba[4]);
void look_of_instrument(const struct instrument *instrument, float out_rgba[4]);

// A shaft along z that ends in a cone at the tip, in the frame of the tip, as thick as the body.
// The caller releases it with mesh_fini.
void look_instrument(const struct instrument_body *body, struct mesh *out_mesh);

// An ellipsoid about the origin, and its colour. As look_instrument.
void look_loose(vec3 radii_mm, struct mesh *out_mesh, float out_rgba[4]);
