// How the parts of a session look in scenes that other programs show.
#pragma once

#include "case/case.h"
#include "step/settings.h"

enum look { LOOK_BONE, LOOK_MENISCUS, LOOK_LIGAMENT, LOOK_SKIN, LOOK_STEEL, LOOK_COUNT };

const char *look_name(enum look look);
const float *look_rgba(enum look look); // four, 0 to 1
enum look look_of_group(const struct case_group *group);

// A shaft along z that ends in a cone at the tip, in the frame of the tip, as thick as the body.
// The caller releases it with mesh_fini.
void look_instrument(const struct instrument_body *body, struct mesh *out_mesh);
