// When a worker looks at each of its stations: stations that have nothing to do cost nothing. Plain
// state of one thread; no clock.
#pragma once

#include <stdint.h>

// A look comes at most so much too late. One that is asked for later than LOOKS_FARTHEST_NS from
// the last looks_take comes then.
#define LOOKS_TURN_NS 1000000LL
#define LOOKS_FARTHEST_NS (2047 * LOOKS_TURN_NS)

struct looks;

// places: stations, by numbers from 0 on. None is looked at.
struct looks *looks_create(int places);
void looks_destroy(struct looks **looks); // NULL inside is fine

// Looks at the place by then. An earlier look that was asked for stays.
void looks_by(struct looks *looks, int place, int64_t when_ns);

// When looks_take is to be called next: not after `until_ns`.
int64_t looks_next_ns(const struct looks *looks, int64_t until_ns);

// A place whose look has come, and is over with that; -1: there is none now.
int looks_take(struct looks *looks, int64_t now_ns);
