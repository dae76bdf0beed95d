// The newest sample of one channel, and what it is worth at a given time. No threads, no clock.
#pragma once

#include "base/sample.h"
#include "samples/filter.h"
#include "samples/guard.h"
#include "samples/noise.h"
#include "samples/past.h"

#include <stdbool.h>
#include <stdint.h>

struct slot {
    struct sample newest; // neutral until the first sample was used
    struct guard guard;   // of poses and joint angles
    struct noise noise;   // of them
    double noise_mm, noise_deg;
    struct filter filter; // none, unless filter_init is called after slot_init
    struct past past;     // of what was used, filtered
    int64_t hold_ns;      // from silent to lost
    int64_t lag_ns;       // from a measurement to its arrival, nearly at most
    double interval_ns;   // usual time between two samples that were used; 0: not known yet
    int64_t arrived_ns;   // when samples last came
    double gap_ns;        // between the last two arrivals
    double pack_ns;       // usual time between two arrivals of several samples; 0: they come singly
    int64_t silent_ns;    // from when on the channel is silent, if nothing comes before
    enum validity validity;
};

enum slot_verdict { SLOT_USED, SLOT_SILENT, SLOT_JUMP, SLOT_NOISY, SLOT_MALFORMED };

// Leaps of angles are caught from SLOT_JUMP_DEG on, and noise from SLOT_NOISE_MM and
// SLOT_NOISE_DEG, unless the caller changes what is in `guard`, noise_mm and noise_deg.
#define SLOT_JUMP_MM 15
#define SLOT_JUMP_DEG 15
#define SLOT_NOISE_MM 2
#define SLOT_NOISE_DEG 2
void slot_init(struct slot *slot, enum channel channel, enum sample_kind kind, uint8_t device,
               double hold_ms, double jump_mm);

// Takes a sample of the slot's channel and kind, which came at arrival_ns. Not used: one that the
// source calls LOST (SLOT_SILENT), one that frame_is_valid would refuse or that is no newer than
// the last (SLOT_MALFORMED), a jump (SLOT_JUMP), one of a source that shakes (SLOT_NOISY). Any of
// them makes the channel silent from then on.
enum slot_verdict slot_take(struct slot *slot, const struct sample *sample, int64_t arrival_ns);

// What came together was taken: `count` samples that were used, at now_ns. A source that sends
// several at a time is not silent between.
void slot_arrived(struct slot *slot, int count, int64_t now_ns);

// Brings slot->validity to what it is at now_ns. True: it was lost just now.
bool slot_age(struct slot *slot, int64_t now_ns);

// The newest time that a pose or a joint angle tells of. While it is silent for a moment: what it
// would tell then. INT64_MAX: a handle, a force, or one that has been silent for long.
int64_t slot_told_ns(const struct slot *slot, int64_t now_ns);

// The usual time from one new value to the next; 0: not known yet.
double slot_pace_ns(const struct slot *slot);
