// Watches the threads of the runtime. A thread that hangs is named on stderr with what it did last,
// and the process ends by SIGABRT, so that it is started again and resumes its sessions. While all
// go on, the service manager is told so ("WATCHDOG=1", base/service.h).
//
// A thread hangs that has made no progress for its patience and was blocked, or computed, all the
// while. One that only waits for a processor does not hang.
#pragma once

#include "runtime/progress.h"

#include <stdbool.h>
#include <stdint.h>

#define WATCHDOG_LOOK_NS 200000000LL
#define WATCHDOG_WORKER_NS 1500000000LL // a worker waits for nothing and no step takes 10 ms
#define WATCHDOG_CUTS_NS 60000000000LL  // a job may take seconds

// One look at a thread.
struct watch_look {
    int64_t now_ns;
    uint64_t beats;
    int64_t computed_ns; // by the thread so far
    bool waits_for_processor;
};

struct watch {
    int64_t patience_ns;
    uint64_t beats;
    int64_t blocked_ns; // at looks that found it blocked, since it last made progress
    int64_t looked_ns, computed_ns;
    int64_t beat_ns; // when it last made progress, as seen
};

// True: it hangs. A look that comes late shows no block: the whole process was paused, or the
// machine has no time for anybody, perhaps not for the holder of a lock either.
bool watch_judge(struct watch *watch, const struct watch_look *look);

struct watchdog;

struct watched {
    const char *name; // "worker 2"
    struct progress *progress;
    int64_t patience_ns;
};

// station_name: of an index, for the message.
struct watchdog *watchdog_create(const struct watched *watched, int count,
                                 const char *(*station_name)(const void *user, int station),
                                 const void *user);
// When it last found that none hangs; monotonic. Any thread.
int64_t watchdog_looked_ns(const struct watchdog *watchdog);
void watchdog_destroy(struct watchdog **watchdog); // NULL inside is fine
