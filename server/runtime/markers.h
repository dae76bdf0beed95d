// Takes the markers of stations into the traces of their sessions, and acknowledges them. Only the
// station's worker calls these functions.
#pragma once

#include "runtime/parts.h"

// Those that have come, as fast as a station may send them; and the acknowledgement that is due.
void markers_take(struct worker *worker, struct station_runtime *station);

// A connection begins: what came over the one before comes again, unless it is acknowledged.
void markers_join(struct station_runtime *station);

// A session begins. What its trace has of this server's life or of an earlier one is not taken
// again.
void markers_begin(struct station_runtime *station);
