// Captures a session's state now and then, so that it is kept beside its trace. Only the station's
// worker calls these functions.
#pragma once

#include "runtime/parts.h"

void capture_begin(struct station_runtime *station); // a session begins
// Behind each step, before its job is given away. end: the trace's position just behind the step.
void capture_step(struct worker *worker, struct station_runtime *station,
                  const struct session_output *output, uint64_t end);
