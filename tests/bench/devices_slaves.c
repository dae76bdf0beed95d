// Two slaves of one line, each at the most that it gives: what does sharing the line cost them?
#include "base/clock.h"
#include "devices.h"

#include <math.h>
#include <stdio.h>

enum { SLAVES = 3, DEAD = 2, OPTIONS_MAX = 6 };

// The devices of those that are asked; the last one is not there.
static enum result open_slaves(const char *key, const char *line, const bool asked[SLAVES],
                               struct runner **out, struct error *err) {
    static const char *const numbers[] = {"1", "2", "9"};
    static const char *const values[] = {"flexion", "probe.opening", "punch.opening"};
    struct device_option options[SLAVES][OPTIONS_MAX];
    struct device_config configs[SLAVES];
    int count = 0;
    for (int i = 0; i < SLAVES; i++) {
        struct device_option *o = options[count];
        if (!asked[i])
            continue;
        o[0] = (struct device_option){"driver", "modbus"};
        o[1] = (struct device_option){key, line};
        o[2] = (struct device_option){"slave", numbers[i]};
        o[3] = (struct device_option){"rate_hz", "2000"};
        o[4] = (struct device_option){values[i], i ? "10 0.1" : "1 0.01"};
        configs[count] = (struct device_config){.options = o, .option_count = 5};
        snprintf(configs[count++].name, DEVICE_NAME_MAX, "slave %s", numbers[i]);
    }
    return runner_create(configs, count, out, err);
}

static uint64_t readings_of(struct runner *runner, int device) {
    struct device_status status;
    runner_status(runner, device, &status);
    return status.readings;
}

// Readings a second of each slave while those of `asked` are asked.
static enum result measure(const char *key, const char *line, const bool asked[SLAVES],
                           double seconds, double out_hz[SLAVES], struct error *err) {
    uint64_t before[SLAVES];
    struct runner *runner = NULL;
    enum result result = open_slaves(key, line, asked, &runner, err);
    if (result != RESULT_OK)
        return result;
    sleep_until(clock_now_ns() + NS_PER_S / 4); // all are connected by then
    int64_t start_ns = clock_now_ns();
    for (int i = 0; i < runner_count(runner); i++)
        before[i] = readings_of(runner, i);
    sleep_until(start_ns + (int64_t)(seconds * NS_PER_S));
    double elapsed_s = (double)(clock_now_ns() - start_ns) / NS_PER_S;
    for (int i = 0, device = 0; i < SLAVES; device += asked[i++])
        if (asked[i])
            out_hz[i] = (double)(readings_of(runner, device) - before[device]) / elapsed_s;
    runner_destroy(&runner);
    return RESULT_OK;
}

// The lowest share of what half of the line is worth to a slave.
static enum result measure_line(const char *name, const char *key, const char *line, double seconds,
                                double *share, struct report *report, struct error *err) {
    double alone_hz[SLAVES], both_hz[SLAVES], beside_hz[SLAVES];
    enum result result = RESULT_OK;
    for (int i = 0; i < DEAD && result == RESULT_OK; i++)
        result = measure(key, line, (bool[]){i == 0, i == 1, false}, seconds, alone_hz, err);
    if (result == RESULT_OK)
        result = measure(key, line, (bool[]){true, true, false}, seconds, both_hz, err);
    if (result == RESULT_OK)
        result = measure(key, line, (bool[]){true, true, true}, seconds, beside_hz, err);
    for (int i = 0; i < DEAD && result == RESULT_OK; i++) {
        report_figure(report, alone_hz[i], "readings/s", "%s/slave %d/alone", name, i + 1);
        report_figure(report, both_hz[i], "readings/s", "%s/slave %d/shared", name, i + 1);
        report_figure(report, beside_hz[i], "readings/s", "%s/slave %d/beside a dead one", name,
                      i + 1);
        *share = alone_hz[i] > 0 ? fmin(*share, both_hz[i] / (alone_hz[i] / 2)) : 0;
        if (beside_hz[DEAD] > 0)
            return fail(err, RESULT_INVALID, "%s: a slave answers that is not there", name);
    }
    return result;
}

enum result bench_slaves(const bool chosen[LINES], bool quick, struct report *report,
                         struct error *err) {
    double seconds = quick ? 0.7 : 5, share = INFINITY;
    struct mockup m;
    if (!chosen[MODBUS_TCP] && !chosen[MODBUS_RTU])
        return RESULT_OK;
    enum result result = mockup_start("", 1000, &m, err);
    if (result == RESULT_OK && chosen[MODBUS_TCP])
        result = measure_line("modbus-tcp", "address", m.modbus_tcp, seconds, &share, report, err);
    if (result == RESULT_OK && chosen[MODBUS_RTU])
        result = measure_line("modbus-rtu", "serial", m.serial, seconds, &share, report, err);
    mockup_end(&m);
    if (result == RESULT_OK)
        report_mark(report, "two_slaves_rate_share", share, "times", 0.95, BETTER_HIGH);
    return result;
}
