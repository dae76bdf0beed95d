// What a late frame tells that no frame after it has told: samples newer than any taken, presses
// and releases of a handle's buttons, and how far a jaw was closed or opened in between. The next
// frame takes it along, if it is still valid then. Poses never go back: of all other samples the
// newest counts. Plain state of one connection, on the station's clock.
#pragma once

#include "base/sample.h"

#define LATE_HANDLES 64 // values of each handle that are remembered: a power of two

struct handle_told {
    uint64_t number; // of its frame; 0: none
    struct handle handle;
};

// Of one instrument, to be taken along.
struct late_handle {
    int64_t time_ns; // when it was measured; 0: there is nothing
    uint32_t pressed, released;
    bool has_opening;
    double opening;
};

struct late_frames {
    int64_t told_ns[CHANNEL_COUNT][SAMPLE_KIND_COUNT]; // of the newest sample that was taken
    struct handle_told handles[INSTRUMENT_COUNT][LATE_HANDLES]; // [number % LATE_HANDLES]
    struct late_handle late[INSTRUMENT_COUNT];
    int count;
    struct sample newer[FRAME_SAMPLES_MAX]; // than any taken
};

// Keeps what a late frame alone has told.
void late_frames_keep(struct late_frames *late, const struct frame *frame);

// The newest frame takes along what was kept, where that is no older than hold_ns at this frame.
void late_frames_merge(struct late_frames *late, struct frame *frame, int64_t hold_ns);
