// The steps of a station's session: an input in; trace, metrics, snapshot, jobs and notices out.
// Only the station's worker calls these functions.
#pragma once

#include "runtime/parts.h"

// Without frames, a session that runs steps so often, and more seldom while it rests.
#define EMPTY_STEP_NS (50 * NS_PER_MS)
#define REST_STEP_NS (10 * NS_PER_S)

// Makes a step with the input. If the input's time is before the last step's, it becomes that time.
void step_input(struct worker *worker, struct station_runtime *station, struct session_input *input,
                struct session_output *out_output);
void step_without_frame(struct worker *worker, struct station_runtime *station,
                        enum input_kind kind);
// One undo is on its way at a time: from when it is asked for until NOTICE_UNDONE answers it. False
// where another one is. A reset makes it void, and the notice says that nothing was undone.
bool step_begin_undo(struct station_runtime *station, uint64_t ticket);
void step_void_undo(struct worker *worker, struct station_runtime *station);
// A session ends once the cut that is on its way has landed, so that its trace holds all that is
// shown as cut. False: not yet, and no other cut begins. Ask again after step_results.
bool step_end(struct worker *worker, struct station_runtime *station);
// Gives the session back as it is. The result of a cut that is on its way is dropped.
void step_hand_over(struct worker *worker, struct station_runtime *station);
void step_results(struct worker *worker); // lands the results of the cut worker
// Lands what was cut when the server before this one was killed, or while the session stood still.
void step_land_pending(struct worker *worker, struct station_runtime *station);

// On the session's clock, which is the server's, unless the session began on an earlier server.
int64_t step_now_ns(const struct station_runtime *station);

// Where its worker may not serve, a session goes on while it has frames no older than this.
#define FRESH_NS NS_PER_S
bool step_goes_on(const struct worker *worker, const struct station_runtime *station);

bool step_is_deserted(const struct worker *worker, const struct station_runtime *station);

// Sends a station its session. After the first one the station begins to send frames.
void step_announce(struct worker *worker, const struct station_runtime *station);
// The same, with a text for a person.
void step_tell(struct worker *worker, const struct station_runtime *station, const char *text);
