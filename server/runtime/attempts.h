// Attempts at tasks: begun and left by request, judged by each step. Only the station's worker
// calls these functions, except attempt_state.
#pragma once

#include "runtime/parts.h"

// A session begins, perhaps with an attempt that runs.
void attempts_begin(struct worker *worker, struct station_runtime *station);

// False: the session has one already, has ended, or its trace takes none. Then the attempt goes
// back to its owner.
bool attempts_take(struct worker *worker, struct station_runtime *station,
                   struct session_attempt *attempt);
// False: none runs, or its trace has no room for the end now; then it goes on.
bool attempts_leave(struct worker *worker, struct station_runtime *station, bool by_trainee);
// By the trainee, as the pedal does: an exam goes on. False: the end has no room in the trace now.
bool attempts_leave_practice(struct worker *worker, struct station_runtime *station);

// Behind each step, once it is recorded.
void attempts_step(struct worker *worker, struct station_runtime *station,
                   const struct session_input *input, const struct session_output *output);

// To a station that is new here, or whose session is: the last attempt, or that there was none.
void attempts_announce(struct worker *worker, const struct station_runtime *station);
