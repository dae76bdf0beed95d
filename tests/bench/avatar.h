// The part of `arthron-bench warp` that is about whole instruments.
#pragma once

#include "bench.h"

// What a rigid instrument of eight points takes beside its tip alone; and in touch, how deep it is
// in the virtual surfaces in each mode.
void bench_avatars(const struct bench_options *options, struct report *report);
