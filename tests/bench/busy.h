// Poses on a machine whose processors other programs take.
#pragma once

#include "hall.h"
#include "samples.h"

// Before the hall starts: its server may take real-time priority, and its stations. False: the
// system does not grant it.
bool busy_grant(void);

// Adds round trips in microseconds: on an idle machine, and beside two programs at normal priority
// that compute and take memory as compilers do. Both take turns. The stations run at real-time
// priority, so that what is late is the server. False: the system gives none.
bool busy_compare(const struct hall *hall, int rounds, int64_t lasts_ns,
                  struct samples *out_idle_us, struct samples *out_busy_us);
