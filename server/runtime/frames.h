// Turns the frames of stations, from datagrams and from control connections, into steps and
// replies.
#pragma once

#include "runtime/parts.h"

// Takes the datagrams that have arrived, at most DATAGRAM_BATCH.
void frames_take_datagrams(struct worker *worker);
// Takes a few frames that a station sent over TCP, so that no station starves another. True if some
// are left.
bool frames_take_tcp(struct worker *worker, struct station_runtime *station);
