// The last samples of one channel, so that it can be asked what it was a moment ago. No threads, no
// clock.
#pragma once

#include "base/sample.h"

#define PAST_SAMPLES 1280       // more than a second: as long as a delay may be (delay_ms)
#define PAST_APART_NS 1000000LL // of a faster source it keeps one sample for each such time

// Zeroed: empty.
struct past {
    int count, next; // `next`: where the next sample goes
    struct sample samples[PAST_SAMPLES];
};

// A later sample than all before. A handle's are not kept: a press happens at its own time.
void past_add(struct past *past, const struct sample *sample);

// The channel at that time: joint angles and forces straight, poses straight in translation and
// slerp in rotation between the two samples around it. Never extrapolated: past the ends it is the
// end's sample, with the end's own time. False: empty.
bool past_at(const struct past *past, int64_t time_ns, struct sample *out_sample);

void past_forget(struct past *past);
