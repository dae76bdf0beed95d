// Turns the frames of stations, from datagrams and from control connections, into steps and
// replies.
#pragma once

#include "runtime/parts.h"

// Takes the datagrams that have arrived, at most DATAGRAM_BATCH.
void frames_take_datagrams(struct worker *worker);
// A connection of a station begins: numbers begin anew.
void frames_end_order(struct station_runtime *station);
// From now on the time without a frame counts.
void frames_begin_pause(struct station_runtime *station);
// Counts the frames that have not come for too long.
void frames_settle(struct station_runtime *station);

// Takes a few frames that a station sent over TCP, so that no station starves another. True if some
// are left.
bool frames_take_tcp(struct worker *worker, struct station_runtime *station);
