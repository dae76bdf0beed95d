#include "step/samples.h"

#include "step/output.h"

// From when on the hold counts for a sample that was just told.
static int64_t hold_begins(const struct samples *samples, const struct sample *sample,
                           struct sampling at) {
    const struct sample *newest = &samples->newest[sample->channel][sample->kind];
    bool repeated = samples->known[sample->channel][sample->kind] &&
                    sample->validity == VALIDITY_HELD && sample->time_ns <= newest->time_ns;
    int64_t told_ns = at.from_frame ? at.closed_ns : sample->time_ns;
    if (at.from_frame && repeated)
        told_ns = samples->since_ns[sample->channel][sample->kind];
    return told_ns < at.now_ns ? told_ns : at.now_ns;
}

// The last good value stays when a sample is lost. A time ahead of ours is clock error: taken as
// now, so that no sample is held for longer than another.
uint32_t samples_take(struct samples *samples, const struct sample *sample, struct sampling at) {
    struct sample *newest = &samples->newest[sample->channel][sample->kind];
    bool *known = &samples->known[sample->channel][sample->kind];
    bool was_lost = *known && newest->validity == VALIDITY_LOST;
    int64_t since_ns = hold_begins(samples, sample, at);
    bool is_stale =
        at.from_frame && at.closed_ns - sample->time_ns > SAMPLES_LATE_MAX_NS + at.hold_ns;
    if (sample->validity == VALIDITY_LOST || is_stale || at.now_ns - since_ns > at.hold_ns) {
        newest->validity = VALIDITY_LOST;
        return *known && !was_lost ? EVENT_DEVICE_LOST : 0;
    }
    *newest = *sample;
    if (newest->time_ns > at.now_ns)
        newest->time_ns = at.now_ns;
    samples->since_ns[sample->channel][sample->kind] = since_ns;
    *known = true;
    return was_lost ? EVENT_DEVICE_BACK : 0;
}

// A sample that stopped coming is held, then lost.
uint32_t samples_age(struct samples *samples, int64_t now_ns, int64_t hold_ns) {
    uint32_t events = 0;
    for (int c = 0; c < CHANNEL_COUNT; c++)
        for (int k = 0; k < SAMPLE_KIND_COUNT; k++) {
            struct sample *newest = &samples->newest[c][k];
            if (!samples->known[c][k] || newest->validity == VALIDITY_LOST)
                continue;
            if (now_ns - samples->since_ns[c][k] > hold_ns) {
                newest->validity = VALIDITY_LOST;
                events |= EVENT_DEVICE_LOST;
            }
        }
    return events;
}

bool samples_are_lost(const struct samples *samples) {
    for (int c = 0; c < CHANNEL_COUNT; c++)
        for (int k = 0; k < SAMPLE_KIND_COUNT; k++)
            if (samples->known[c][k] && samples->newest[c][k].validity != VALIDITY_LOST)
                return false;
    return true;
}

const struct sample *samples_last(const struct samples *samples, enum channel channel,
                                  enum sample_kind kind) {
    return samples->known[channel][kind] ? &samples->newest[channel][kind] : NULL;
}
