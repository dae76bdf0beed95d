// What the scope sees: a cone from its tip, tilted from the shaft towards the tip frame's y by the
// angle of the optic; and how long an instrument takes to come into it. Nothing hides anything.
#pragma once

#include "base/pose.h"
#include "step/optic.h"

#include <stdbool.h>
#include <stdint.h>

#define VIEW_REACH_MM 50.0
#define VIEW_FOUND_NS 500000000LL // in view for so long: found
#define VIEW_LOST_NS 1000000000LL // out of view for so long: to be found again

bool view_shows(const struct view_optic *optic, pose scope, vec3 tip);

// One instrument's triangulation. A search begins when instrument and scope are both there, or when
// the instrument has been out of view for VIEW_LOST_NS, at the moment it went out; it ends when the
// instrument came into view to stay for VIEW_FOUND_NS. Where one of the two goes, it is given up.
struct search {
    bool there, searching, in_view;
    int64_t began_ns;
    int64_t changed_ns; // since when in_view is as it is
    int found;          // searches that ended
    int64_t first_ns, all_ns;
};

void search_init(struct search *search);
void search_step(struct search *search, int64_t time_ns, bool there, bool in_view);
double search_first_s(const struct search *search); // NaN where none ended
double search_mean_s(const struct search *search);
