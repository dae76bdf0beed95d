// A session that is run again from the steps of its record. Jobs are run as the session asks for
// them, and land where the record says so. A recorded touch takes the place of the one that the
// job's match found, so a build whose match is another one still gives the recorded session.
#pragma once

#include "trace/trace.h"

struct rerun;

// The scene must outlive it.
struct rerun *rerun_create(const struct scene *scene, const struct session_settings *settings);
// Goes on with a session, with its operation, and with the job that its last step asked for (its id
// 0: none), which it runs. They are the rerun's.
struct rerun *rerun_go_on(struct session *session, struct operation *operation,
                          const struct job *asked);
// The same from the state with which a later part of a trace begins, and which lacks the poses
// behind it.
struct rerun *rerun_go_on_elsewhere(struct session *session, struct operation *operation,
                                    const struct job *asked);
void rerun_destroy(struct rerun **rerun); // NULL inside is fine

// Before the first step: the state with which a later part begins takes the place of a new session.
// Results as of state_session_read.
enum result rerun_take_over(struct rerun *rerun, const struct trace_state *state,
                            struct error *err);

// Calls `landed` for each result: after the step at which it lands, before the next job is run.
void rerun_watch(struct rerun *rerun, void (*landed)(void *user, const struct job_result *result),
                 void *user);

// One TRACE_STEP, TRACE_PAST or TRACE_TAKEN, in order. A job that was taken over is run here, too;
// whether it landed as there, rerun_lands_as_recorded tells of its record and of the output.
void rerun_step(struct rerun *rerun, const struct trace_record *record,
                struct session_output *out_output);
bool rerun_lands_as_recorded(const struct trace_record *record,
                             const struct session_output *output);

// Recorded touches that landed, beside those of the match of this build.
struct rerun_touches {
    uint64_t landed, different;
    uint64_t first_step, first_job; // that differs
    double largest_mm;              // distance between the two
};

struct rerun_touches rerun_touches(const struct rerun *rerun);

// The same for other settings or another case, where the session may ask for other jobs than the
// recorded one did. A job lands where the record has a landing, or half a second after it was asked
// for. In the second case it lands in an extra step before this one, which out_landed describes.
// Recorded touches do not count.
void rerun_step_freely(struct rerun *rerun, const struct trace_record *record,
                       struct session_output *out_output, struct landed *out_landed);

// The tissue after all jobs so far.
const struct operation *rerun_operation(const struct rerun *rerun);

// Ends the rerun and gives its session to the caller, to go on with it. *out_pending is the result
// that has not landed yet, or NULL; *out_asked its job, or one with the id 0 (NULL: it
// is not needed).
void rerun_release(struct rerun **rerun, struct session **out_session,
                   struct operation **out_operation, struct job_result **out_pending,
                   struct job *out_asked);
