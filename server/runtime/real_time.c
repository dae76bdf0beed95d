#include "runtime/real_time.h"

#include "base/clock.h"

#include <sched.h>
#include <sys/resource.h>

#define LOOK_NS (100 * NS_PER_MS)
#define BUSY_MOST 0.8
#define BUSY_LEAST 0.5

static bool set(bool on) {
    struct sched_param parameters = {.sched_priority = on ? REAL_TIME_PRIORITY : 0};
    // Who took the flag without a privilege cannot give it back.
    int policy = SCHED_RESET_ON_FORK | (on ? SCHED_RR : SCHED_OTHER);
    return !sched_setscheduler(0, policy, &parameters);
}

// Who is root could always take it, and then a second server on the same machine would suffer.
static bool is_granted(void) {
    struct rlimit limit;
    return !getrlimit(RLIMIT_RTPRIO, &limit) && limit.rlim_cur >= REAL_TIME_PRIORITY;
}

bool real_time_begin(struct real_time *r, int64_t now_ns) {
    bool given = is_granted() && set(true);
    *r = (struct real_time){.is_allowed = given, .is_on = given, .looked_ns = now_ns};
    return given;
}

void real_time_waited(struct real_time *r, int64_t begin_ns, int64_t now_ns) {
    r->waited_ns += now_ns - begin_ns;
    int64_t passed_ns = now_ns - r->looked_ns;
    if (!r->is_allowed || passed_ns < LOOK_NS)
        return;
    double busy = 1 - (double)r->waited_ns / (double)passed_ns;
    bool on = r->is_on ? busy <= BUSY_MOST : busy < BUSY_LEAST;
    if (on != r->is_on && set(on))
        r->is_on = on;
    r->looked_ns = now_ns;
    r->waited_ns = 0;
}
