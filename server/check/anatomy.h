// The sizes and places of a knee's parts, in extension, by the bounds of check/bounds.h: the widths
// of condyles and plateau, the menisci's volumes, the patella's size and place over the trochlea,
// and the way from the frame's origin to the joint.
#pragma once

#include "check/inspect.h"

// The case must have passed case_validate. Parts that it does not have are left out.
void anatomy_inspect(struct knee_case *knee, struct inspection *inspection);
