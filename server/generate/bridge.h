// Ligaments that bridge two bones, and the skin round both: how much of each vertex goes with the
// other one.
//
//     share = d_body / (d_body + d_other)
//
// from the distances to both bones' physical surfaces in the rest pose: 0 on the bone of the
// group's body, 1 on the other, 1/2 where both are touched. Inside a closed bone the distance is 0,
// so that an insertion goes whole with its bone.
#pragma once

#include "case/case.h"

// Makes the group bridge to another body, whose bone bears its name. The group has its parts.
// RESULT_INVALID: it is of that body itself; RESULT_MISSING, naming it: one of the bones is not
// there, or has no mesh.
enum result bridge_make(struct knee_case *knee, struct case_group *group, enum body other,
                        struct error *err);
