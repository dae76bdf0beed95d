#include "sim/report.h"

#include "base/clock.h"
#include "sim/threads.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define KEPT 40

static struct {
    uint64_t seed, hash;
    bool verbose;
    unsigned count;
    void (*at_end)(void);
    char last[KEPT][192];
} report;

void report_begin(uint64_t seed, bool verbose) {
    report.seed = seed;
    report.hash = 0xcbf29ce484222325u;
    report.verbose = verbose;
    report.count = 0;
}

void report_at_end(void (*run)(void)) {
    report.at_end = run;
}

void report_hash(uint64_t value) {
    report.hash = (report.hash ^ value) * 0x100000001b3u;
    report.hash ^= report.hash >> 29;
}

uint64_t report_take_hash(void) {
    return report.hash;
}

static double seconds(void) {
    return (double)(sim_now_ns() - SIM_BEGIN_NS) / NS_PER_S;
}

void happened(const char *format, ...) {
    char *line = report.last[report.count++ % KEPT];
    va_list args;
    va_start(args, format);
    int used = snprintf(line, sizeof report.last[0], "%11.6f ", seconds());
    vsnprintf(line + used, sizeof report.last[0] - (size_t)used, format, args);
    va_end(args);
    if (report.verbose)
        fprintf(stderr, "%s\n", line);
}

_Noreturn void broken(const char *expected, const char *found, ...) {
    va_list args;
    fflush(stdout);
    fprintf(stderr,
            "sim: broken at seed %" PRIu64 ", %.6f s\n  expected: %s\n  found: ", report.seed,
            seconds(), expected);
    va_start(args, found);
    vfprintf(stderr, found, args);
    va_end(args);
    fprintf(stderr, "\n  the last events:\n");
    unsigned first = report.count > KEPT ? report.count - KEPT : 0;
    for (unsigned i = first; i < report.count && !report.verbose; i++)
        fprintf(stderr, "    %s\n", report.last[i % KEPT]);
    fprintf(stderr, "  again: tests/sim/run --seed %" PRIu64 "\n", report.seed);
    if (report.at_end)
        report.at_end();
    _exit(1);
}

// A CHECK of the programs under test.
_Noreturn void __wrap_check_failed(const char *condition, const char *file, int line,
                                   const char *function);
_Noreturn void __wrap_check_failed(const char *condition, const char *file, int line,
                                   const char *function) {
    broken("every CHECK holds", "%s:%d: %s: %s", file, line, function, condition);
}
