#include "busy.h"

#include "base/check.h"
#include "base/clock.h"

#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#define PROGRAMS 2
#define STATION_HZ 100
#define STATION_PRIORITY 20
#define FILE_BYTES (32 << 20)
#define FILE_NS (50 * NS_PER_MS)

// ---- the other programs -------------------------------------------------------------------------

// As a compiler of one file: memory that is new, and computing.
static void compile_file(void) {
    int64_t begin_ns = clock_now_ns();
    volatile uint32_t *memory = alloc(1, FILE_BYTES);
    for (uint32_t at = 1; clock_now_ns() - begin_ns < FILE_NS;)
        for (int i = 0; i < 4096; i++) {
            at = at * 1664525u + 1013904223u;
            memory[at % (FILE_BYTES / sizeof *memory)] += at;
        }
    _exit(0);
}

static void end_with_parent(void) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
}

static pid_t start_compiler(void) {
    pid_t pid = fork();
    if (pid)
        return pid;
    end_with_parent();
    for (;;) {
        pid_t file = fork();
        if (!file) {
            end_with_parent();
            compile_file();
        }
        waitpid(file, NULL, 0);
    }
}

static void end_compilers(const pid_t *pids) {
    for (int i = 0; i < PROGRAMS; i++) {
        kill(pids[i], SIGKILL);
        waitpid(pids[i], NULL, 0);
    }
}

bool busy_grant(void) {
    struct rlimit limit = {STATION_PRIORITY, STATION_PRIORITY};
    return !setrlimit(RLIMIT_RTPRIO, &limit);
}

// ---- the stations -------------------------------------------------------------------------------

static bool set_priority(int priority) {
    struct sched_param parameters = {.sched_priority = priority};
    int policy = priority ? SCHED_RR | SCHED_RESET_ON_FORK : SCHED_OTHER;
    return !sched_setscheduler(0, policy, &parameters);
}

static void take(const struct hall *hall, int64_t lasts_ns, struct samples *out) {
    struct load load = {STATION_HZ, lasts_ns, .sleeps = true};
    struct load_result result = {0};
    load_run(hall->callers, hall->caller_count, &load, &result);
    for (size_t i = 0; i < result.round_trips_us.count; i++)
        samples_add(out, result.round_trips_us.values[i]);
    load_result_fini(&result);
}

bool busy_compare(const struct hall *hall, int rounds, int64_t lasts_ns,
                  struct samples *out_idle_us, struct samples *out_busy_us) {
    if (!set_priority(STATION_PRIORITY))
        return false;
    for (int i = 0; i < rounds; i++) {
        pid_t compilers[PROGRAMS];
        take(hall, lasts_ns, out_idle_us);
        for (int k = 0; k < PROGRAMS; k++)
            NEED((compilers[k] = start_compiler()) >= 0, "process");
        take(hall, lasts_ns, out_busy_us);
        end_compilers(compilers);
    }
    set_priority(0);
    return true;
}
