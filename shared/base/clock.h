// Monotonic time, and the offset between two machines' monotonic clocks.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define NS_PER_S 1000000000LL
#define NS_PER_MS 1000000LL

int64_t clock_now_ns(void); // CLOCK_MONOTONIC
int64_t clock_utc_ns(void); // since 1970-01-01 UTC
void clock_utc_text(int64_t utc_ns, char out[32]); // "2026-11-21T08:30:00.123Z"

// Estimates remote - local from exchanges of time stamps (as NTP does): the exchange with the
// shortest round trip of the last CLOCK_OFFSET_WINDOW wins, and its uncertainty is half of that
// round trip plus what two crystals drift apart since (100 ppm).
#define CLOCK_OFFSET_WINDOW 16

struct clock_exchange {
    int64_t offset_ns, round_trip_ns, local_ns;
};

struct clock_offset {
    struct clock_exchange exchanges[CLOCK_OFFSET_WINDOW];
    int count, next;
};

// A zeroed struct clock_offset knows nothing.
// sent and received on the local clock, remote_received and remote_sent on the remote one.
// An exchange that contradicts itself (negative round trip) is ignored and false returned. One that
// no drift reconciles with those before tells that a clock was stepped: it replaces them.
bool clock_offset_add(struct clock_offset *offset, int64_t sent_ns, int64_t remote_received_ns,
                      int64_t remote_sent_ns, int64_t received_ns);

// The median round trip of the exchanges that are kept; 0 while there is none.
int64_t clock_offset_round_trip_ns(const struct clock_offset *offset);

// False while nothing is known. remote = local + *out_offset_ns, within ± *out_uncertainty_ns.
bool clock_offset_get(const struct clock_offset *offset, int64_t local_now_ns,
                      int64_t *out_offset_ns, int64_t *out_uncertainty_ns);
