// Frames of many stations at once, by datagram: to a server, or to an echo that gives each back.
#pragma once

#include "base/sample.h"
#include "samples.h"
#include "wire/seal.h"

#define LOAD_FLIGHT 1024 // frames of one caller that are remembered: a power of two

// One station's socket and keys.
struct caller {
    int fd;
    struct seal *to_server, *to_station; // NULL: nothing is sealed
    bool echoes;                         // what answers is an echo
    uint64_t number;                     // of the last frame
    int64_t sent_ns[LOAD_FLIGHT];        // [number % size]; 0: answered
    bool waits;                          // its last frame has no answer yet
    int64_t due_ns;                      // when its next frame goes, of an open loop
};

struct load {
    double rate_hz; // of each caller; 0: each sends once its answer is there (a closed loop)
    int64_t lasts_ns;
    bool sleeps; // until the next frame is due: who calls at real-time priority must
};

struct load_result {
    uint64_t sent, answered;
    struct samples round_trips_us;
};

// The joint, and a probe that goes round above the medial plateau at 30 mm/s.
struct frame load_frame(uint64_t number, int64_t now_ns);

// Zero-initialise *out; its samples are added to. Callers go on where they stopped.
void load_run(struct caller *callers, int count, const struct load *load, struct load_result *out);
void load_result_fini(struct load_result *result);
