// The steps of a station's session: an input in; trace, metrics, snapshot, jobs and notices out.
// All by the station's worker.
#pragma once

#include "runtime/parts.h"

// The session takes the input, whose time may be raised to that of the step before.
void step_input(struct worker *worker, struct station_runtime *station, struct session_input *input,
                struct session_output *out_output);
void step_without_frame(struct worker *worker, struct station_runtime *station,
                        enum input_kind kind);
// Gives the session back as it is.
void step_hand_over(struct worker *worker, struct station_runtime *station);
void step_results(struct worker *worker); // those of the cut worker land

// On the session's clock, which is the server's, unless the session began on an earlier server.
int64_t step_now_ns(const struct station_runtime *station);

bool step_is_deserted(const struct worker *worker, const struct station_runtime *station);

// Tells a station what its session is; from the first of these on it sends frames.
void step_announce(struct worker *worker, const struct station_runtime *station);

// A session that is new here, or resumed.
void step_begin(struct worker *worker, struct station_runtime *station,
                struct session_runtime *session);
