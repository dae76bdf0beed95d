// The attempt at a task that viewers are shown: as the server last told it, its time gone on with
// the station's clock. No socket, no clock, no thread.
#pragma once

#include "wire/wire.h"

// A zeroed one is that of a session that had none yet.
struct shown_attempt {
    arthron_ViewAttempt told;
    int64_t now_ns;
};

// What the server told.
void shown_attempt_take(struct shown_attempt *shown, const arthron_AttemptState *state);

// Time passes, for the attempt while the session runs.
void shown_attempt_go_on(struct shown_attempt *shown, int64_t now_ns, bool session_runs);

void shown_attempt_put(const struct shown_attempt *shown, arthron_View *view);
