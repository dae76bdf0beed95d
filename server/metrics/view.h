// The view of the scope, and how long an instrument takes to come into it. The view is a cone from
// the scope's tip. The optic's angle tilts it from the shaft towards the y axis of the tip's frame.
// Nothing occludes the view.
#pragma once

#include "base/pose.h"
#include "step/optic.h"

#include <stdbool.h>
#include <stdint.h>

#define VIEW_REACH_MM 50.0
#define VIEW_FOUND_NS 500000000LL // in view for so long: found
#define VIEW_LOST_NS 1000000000LL // out of view for so long: to be found again

bool view_shows(const struct view_optic *optic, pose scope, vec3 tip);

// One instrument's triangulation. A search begins when instrument and scope are both present. It
// also begins once the instrument has been out of view for VIEW_LOST_NS, and then counts from the
// moment it left the view. It ends when the instrument comes into view and stays for VIEW_FOUND_NS.
// If instrument or scope leaves, the search does not count.
struct search {
    bool there, searching, in_view;
    int64_t began_ns;
    int64_t changed_ns; // time of the last change of in_view
    int found;          // number of searches that ended
    int64_t first_ns, all_ns;
};

void search_init(struct search *search);
void search_step(struct search *search, int64_t time_ns, bool there, bool in_view);
double search_first_s(const struct search *search); // NaN where none ended
double search_mean_s(const struct search *search);
