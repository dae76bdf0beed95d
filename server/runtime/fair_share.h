// What one station may take of its worker: frames, and bytes of trace. What is beyond that is left
// out, and the station's session goes on. Plain state of the worker; the same for each station.
#pragma once

#include "base/bucket.h"

// A station sends at most 2,000 frames a second. After a pause of the network many come at once.
#define FAIR_FRAMES_HZ 2500
#define FAIR_FRAMES_BURST 1000
#define FAIR_TRACE_BYTES_S 6e6
#define FAIR_TRACE_BYTES_BURST 32e6 // a large cut may take 10 MB
#define FAIR_TELL_NS 60000000000LL  // a station is told once in so long

struct fair_share {
    struct bucket frames, bytes;
    uint64_t trace_bytes; // of the session's trace, when last looked at
};

// Takes a frame of the share. False: there is none left.
bool fair_share_take(struct fair_share *share, int64_t now_ns);

// The trace has so many bytes now.
void fair_share_record(struct fair_share *share, uint64_t trace_bytes);
