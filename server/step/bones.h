// Where the bones of the mock-up are.
#pragma once

#include "case/case.h"
#include "step/output.h"
#include "step/samples.h"

// Fills in T_mockup_body, joint and joint_validity. An untracked femur is the mock-up's own frame.
// What is lost stays where it was last seen: a bone that jumped would take the surfaces under the
// instruments with it.
void step_bones_place(const struct samples *samples, const struct knee_case *knee,
                      struct session_output *out);
