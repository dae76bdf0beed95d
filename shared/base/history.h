// The last poses of one body, and the pose at any time near them.
#pragma once

#include "base/pose.h"

#include <stdint.h>

#define HISTORY_LENGTH 16

struct history {
    int64_t time_ns[HISTORY_LENGTH];
    pose poses[HISTORY_LENGTH];
    int count; // how many are there, up to HISTORY_LENGTH
    int next;  // where the next one goes
};

enum history_quality {
    HISTORY_NONE,         // no pose can be given
    HISTORY_EXACT,        // measured at that time
    HISTORY_INTERPOLATED, // between two measurements
    HISTORY_PREDICTED     // after the newest: its velocity carried on
};

// Where the pose lies that has `newer` newer ones.
static inline int history_place(const struct history *history, int newer) {
    return (history->next - 1 - newer + 2 * HISTORY_LENGTH) % HISTORY_LENGTH;
}

// A zeroed struct history is empty.
// Times must rise; a pose that is not newer than the newest is ignored and false returned.
bool history_add(struct history *history, int64_t time_ns, pose p);

// The pose at time_ns. Before the oldest, or later than the newest by more than
// `longest_prediction_ns`: HISTORY_NONE, and *out_pose is not written.
enum history_quality history_at(const struct history *history, int64_t time_ns,
                                int64_t longest_prediction_ns, pose *out_pose);
