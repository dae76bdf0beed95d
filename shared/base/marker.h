// Something that happened at a station and that no pose tells: a button, a coil or a register that
// synchronises the session with another device. It is recorded in the session's trace, but is no
// input of the session.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define MARKER_TEXT_MAX 32

// The name of a pedal's marker: held for a second, it ends an attempt of practice. 0: it is let go.
#define MARKER_DONE "attempt.done"

struct marker {
    uint64_t run;    // of the station's program that made it: a random number
    uint64_t number; // in its run, from 1; a number that is missing was lost
    int64_t time_ns; // when it was measured: on the station's clock, in a trace on the session's
    double value;    // of what was measured: 1 a button that is pressed, 0 one that is released
    char name[MARKER_TEXT_MAX];   // from the station's config
    char device[MARKER_TEXT_MAX]; // too
};

// 1 to 31 letters, digits, -, _ and dots.
bool marker_name_is_valid(const char *name);

// A number from 1, a finite value, a name, and a device's name without control characters.
bool marker_is_valid(const struct marker *marker);
