// Where the session will show an instrument, once what cuts changed of the touch is eased in: the
// eye of a hand that goes on until the image is where it wants it. For this room only.
#pragma once

#include "motion/move.h"
#include "step/session.h"

struct forecast;

// Of a group of the case, which may be one that can be cut. The scene must outlive it.
struct forecast *forecast_create(const struct scene *scene, int group);
void forecast_destroy(struct forecast **forecast); // NULL inside is fine

// The group's touched surface as it is now, and the joint.
void forecast_take(struct forecast *forecast, const struct operation *operation,
                   const struct joint_angles *joint);

// T_mesh_tip in the frame of the patient's group, as a cut has it, of an instrument with its tip
// there in the mock-up's frame, which is the femur's.
pose forecast_tool(const struct forecast *forecast, enum channel tool, vec3 portal,
                   pose T_mockup_tip);

// T_mockup_mesh of the group.
pose forecast_body(const struct forecast *forecast);

// Where the hand that is turned so about its shaft (radians) holds the tip to see its image there:
// it goes on until it does. Both in the mock-up's frame.
vec3 forecast_aim(const struct forecast *forecast, const struct plan *plan, const struct hand *hand,
                  double roll, vec3 image);
