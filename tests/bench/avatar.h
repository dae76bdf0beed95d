// The part of `arthron-bench warp` that is about whole instruments, and of `fidelity` too.
#pragma once

#include "bench.h"

// What a rigid instrument of eight points takes beside its tip alone; and in touch, how deep it is
// in the virtual surfaces in each mode.
void bench_avatars(const struct bench_options *options, struct report *report);

// How deep, and how far its tip hovers, alone.
struct avatar_touch {
    double rigid_over_tip; // the shaft touches: mean depth of its points in virtual surfaces
    double tip_gap_p99_mm; // the tip touches: `rigid`
};

struct avatar_touch bench_avatar_touch(const struct bench_options *options, struct report *report);
