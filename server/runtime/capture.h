// Captures a session's state now and then, so that it is kept beside its trace. Only the station's
// worker calls these functions.
#pragma once

#include "runtime/parts.h"

// A session begins.
void capture_begin(const struct worker *worker, struct station_runtime *station);
// Behind each step, before its job is given away. end: the trace's position just behind the step.
void capture_step(struct worker *worker, struct station_runtime *station,
                  const struct session_output *output, uint64_t end);
