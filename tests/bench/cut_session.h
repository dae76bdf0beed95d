// Cuts in a session: what they cost the poses beside them, and what a hand feels of them.
#pragma once

#include "bench.h"

// Marks pose_p999_cutting_over_idle and jump_over_easing_bound.
enum result bench_cut_session(const struct bench_options *options, struct report *report,
                              struct error *err);
