// From where the scope sees a goal's landmark as the judge sees it. For this room only.
#pragma once

#include "rehearsal/planner.h"

struct view {
    vec3 tip; // in the mock-up's frame
    double roll_deg;
};

// With the joint as the plan holds it. wish_mm: from how far to look where the goal leaves it open,
// 0: as usual. False where no tip that the bones let see it; *p->err says so.
bool find_view(struct planner *p, int goal, double wish_mm, struct view *out);
