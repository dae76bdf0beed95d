// Where the session will show an instrument, once what cuts changed of the touch is eased in: the
// eye of a hand that goes on until the image is where it wants it. For this room only.
#pragma once

#include "motion/move.h"
#include "step/session.h"

struct forecast;

// The scene must outlive it.
struct forecast *forecast_create(const struct scene *scene, int tissue);
void forecast_destroy(struct forecast **forecast); // NULL inside is fine

// The tissue's touched surface as it is now, and the joint.
void forecast_take(struct forecast *forecast, const struct operation *operation,
                   const struct joint_angles *joint);

// T_mesh_tip in the frame of the patient's tissue, as a cut has it, of an instrument with its tip
// there in the mock-up's frame, which is the femur's.
pose forecast_tool(const struct forecast *forecast, enum channel tool, vec3 portal,
                   pose T_mockup_tip);

// T_mockup_mesh of the tissue.
pose forecast_body(const struct forecast *forecast);
