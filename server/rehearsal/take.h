// Loose bodies taken out, as steps of a motion. For this room only.
#pragma once

#include "motion/motion.h"

// One after the other (a bit each): the scope looks at it, from so far (0: as it comes), and the
// grasper takes it out through that portal.
void take_out(struct motion_script *script, const struct knee_case *knee, uint32_t which,
              const char *portal, double distance);
