// A session that is run again from the steps of its record. Jobs are run as the session asks for
// them, and land where the record says so.
#pragma once

#include "trace/trace.h"

struct rerun;

// The scene must outlive it.
struct rerun *rerun_create(const struct scene *scene, const struct session_settings *settings);
void rerun_destroy(struct rerun **rerun); // NULL inside is fine

// Who is told of each result as it lands: after its step, and before the session's next job is run.
void rerun_watch(struct rerun *rerun, void (*landed)(void *user, const struct job_result *result),
                 void *user);

// One TRACE_STEP or TRACE_PAST, in order.
void rerun_step(struct rerun *rerun, const struct trace_record *record,
                struct session_output *out_output);

// The same where the session may ask for other jobs than the recorded one did, as under other
// settings: a job lands where the record says that one does, or half a second after it was asked
// for. That takes a step of its own before this one, whose landing out_landed says.
void rerun_step_freely(struct rerun *rerun, const struct trace_record *record,
                       struct session_output *out_output, struct landed *out_landed);

// Its tissue after all jobs that were asked for so far.
const struct operation *rerun_operation(const struct rerun *rerun);

// Gives the session out of hand, to go on with it: the job whose result has not landed yet is in
// *out_pending, or NULL. The rerun is gone.
void rerun_release(struct rerun **rerun, struct session **out_session,
                   struct operation **out_operation, struct job_result **out_pending);
