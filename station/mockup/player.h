// What the mock-up does at any moment: a file that is played in a loop from the start of the
// program.
#pragma once

#include "drivers/recording.h"

#include <stdbool.h>
#include <stdint.h>

struct player {
    struct recording recording;
    int64_t start_ns; // on the monotonic clock
};

double player_seconds(const struct player *player, int64_t now_ns); // since the start

// The file's own time at `seconds` after the start.
double player_file_time(const struct player *player, double seconds);

// When the file's row is played for the `round`th time, from 0.
int64_t player_row_ns(const struct player *player, int64_t round, int row);

// What a device that synchronises others does: it is on in the first half of each quarter of a
// second of the PC's monotonic clock, so every program on this PC knows when.
#define PLAYER_PULSE_NS INT64_C(250000000)
bool player_pulse(int64_t now_ns);
