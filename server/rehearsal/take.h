// Loose bodies taken out. For this room only.
#pragma once

#include "rehearsal/planner.h"

// One after the other (a bit each): the scope looks at it, from so far (0: as it comes), and the
// grasper takes it out. Plans its steps and plays all but the last; false where one is refused.
bool take_out(struct planner *p, uint32_t which, double distance);
