// What stations and pages are told of an attempt, and what its trace holds. From any thread.
#pragma once

#include "runtime/types.h"
#include "wire/wire.h"

void attempt_state(const struct session_attempt *attempt, arthron_AttemptState *out_state);

// What stays for those who must not know how an exam goes.
void attempt_state_withhold(arthron_AttemptState *state);

// text: valid as long as the attempt.
void attempt_begun(const struct session_attempt *attempt, struct trace_attempt *out_begun);
// It has ended.
void attempt_outcome(const struct session_attempt *attempt, struct trace_outcome *out_outcome);
