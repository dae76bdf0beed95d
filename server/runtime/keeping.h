// When a session's state is kept: as soon as running it again from its last one would take about a
// tenth of a second.
#pragma once

#include "step/output.h"

struct keeping {
    int64_t next_ns;      // not before, on the session's clock
    uint32_t steps, jobs; // since the state was last kept
};

// bytes: of the state that was kept last; 0: none. So a session writes no more than 1 MB a second.
void keeping_begin(struct keeping *keeping, int64_t time_ns, uint64_t bytes);
void keeping_begin_at_once(struct keeping *keeping); // the next step is due
// The session's next step: whether to keep it.
bool keeping_is_due(struct keeping *keeping, const struct session_output *output);
