#include "runtime/keeping.h"

#include "base/clock.h"

// What takes about a tenth of a second to run again,
#define STEPS 1000
#define JOBS 2
// and what a session may write for it: a few times as much as its trace.
#define LEAST_NS (10 * NS_PER_S)
#define NS_PER_BYTE 1000

void keeping_begin(struct keeping *keeping, int64_t time_ns, uint64_t bytes) {
    int64_t apart_ns = (int64_t)bytes * NS_PER_BYTE;
    *keeping = (struct keeping){.next_ns = time_ns + (apart_ns > LEAST_NS ? apart_ns : LEAST_NS)};
}

void keeping_begin_at_once(struct keeping *keeping) {
    *keeping = (struct keeping){.next_ns = INT64_MIN, .steps = STEPS};
}

bool keeping_is_due(struct keeping *keeping, const struct session_output *output) {
    keeping->steps++;
    keeping->jobs += output->landed.job != 0;
    return (keeping->steps >= STEPS || keeping->jobs >= JOBS) &&
           output->time_ns >= keeping->next_ns;
}
