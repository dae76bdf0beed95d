// The markers of a session. The station's slot keeps the newest for the pages. The trace keeps them
// all.
#pragma once

#include "base/marker.h"
#include "wire/wire.h"

#define MARKERS_KEPT 1024

// Use only under the slot's lock.
struct marker_list {
    uint64_t session;   // its serial
    uint64_t count;     // that came
    struct marker *all; // by (n - 1) % MARKERS_KEPT, of the n-th
};

// A session begins. before: NULL, or its markers from before the server was killed, which are moved
// here; *before is empty afterwards.
void marker_list_begin(struct marker_list *list, uint64_t session, struct marker_list *before);
void marker_list_fini(struct marker_list *list);

void marker_list_put(struct marker_list *list, const struct marker *marker);

// Those behind the first *told, at most `room`: the oldest first, as far as they are kept. Returns
// how many, and sets *told behind them.
int marker_list_get(const struct marker_list *list, uint64_t *told, struct marker *out, int room);
