// Which groups one instrument touched, how often, how long and how deep.
//
// A touch begins when the tip is nearer than 0.2 mm to a physical surface and ends when it is
// farther than 0.4 mm, as the session's events do. A touch that begins within 0.2 s of the last one
// continues it, so noise makes no touches. A touch counts once for each group that was the nearest
// during it. Depth is the step's penetration, in the nearest group.
#pragma once

#include "case/case.h"

#include <stdint.h>

#define TOUCH_BEGINS_MM 0.2
#define TOUCH_ENDS_MM 0.4
#define TOUCH_APART_NS 200000000LL

// Depths from 0.1, 0.5 and 1 mm on.
#define TOUCH_DEPTHS 3
extern const double touch_depth_mm[TOUCH_DEPTHS];

struct group_touch {
    uint32_t count;
    int64_t touching_ns;
    int64_t deep_ns[TOUCH_DEPTHS]; // between that depth and the next
    double deepest_mm;
};

struct touch {
    bool touching;
    int64_t last_ns;     // time of the last step in touch
    uint32_t groups_now; // of this touch, a bit each
    struct group_touch groups[CASE_GROUPS_MAX];
};

void touch_init(struct touch *touch);
// nearest: the nearest group, -1 if none is in reach.
void touch_step(struct touch *touch, int64_t time_ns, int nearest, double nearest_mm);
// Counts the values of a step for passed_ns, the time until the next step.
void touch_pass(struct touch *touch, int nearest, double penetration_mm, int64_t passed_ns);
