// A session begins at its station. Only the station's worker calls this.
#pragma once

#include "runtime/parts.h"

// A new or resumed session. The station must have none.
void session_begin(struct worker *worker, struct station_runtime *station,
                   struct session_runtime *session);
