// Which groups one instrument touched, how often, how long and how deep.
//
// A touch begins where the tip is nearer than 0.2 mm to a physical surface and ends where it is
// farther than 0.4 mm (as the session's events). One that begins within 0.2 s is still the same:
// noise makes no touches. It counts once for each group that was the nearest in it, however often
// that changes. Depth is the step's penetration, in the nearest group.
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
    int64_t last_ns;     // when it last did
    uint32_t groups_now; // of this touch, a bit each
    struct group_touch groups[CASE_GROUPS_MAX];
};

void touch_init(struct touch *touch);
// nearest: -1 where no group is in reach.
void touch_step(struct touch *touch, int64_t time_ns, int nearest, double nearest_mm);
// What stands from this step to the next, after passed_ns.
void touch_pass(struct touch *touch, int nearest, double penetration_mm, int64_t passed_ns);
