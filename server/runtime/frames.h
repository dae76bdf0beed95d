// Frames of stations, by datagram and over the control connection, into steps and replies.
#pragma once

#include "runtime/parts.h"

// Takes the datagrams that are there, at most DATAGRAM_BATCH.
void frames_take_datagrams(struct worker *worker);
// Takes what a station sent over TCP, a few frames at a time, so that no station starves another.
// True where some are left.
bool frames_take_tcp(struct worker *worker, struct station_runtime *station);
