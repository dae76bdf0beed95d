// Devices: how fast each driver is, and what a station makes of each fault.
#include "devices.h"

#include "base/check.h"
#include "base/clock.h"
#include "bench.h"
#include "noise_table.h"
#include "samples.h"
#include "wire/seal.h"
#include "wire/wire.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double device_hz = 500, loop_hz = 1000;

// ---- the drivers --------------------------------------------------------------------------------

const char *line_name(enum line line) {
    static const char *const names[LINES] = {"modbus-tcp", "modbus-rtu", "tracker",
                                             "hid",        "recorded",   "simulated"};
    return names[line];
}

enum { OPTIONS_MAX = 6 };

enum result line_open(const struct mockup *m, enum line line, double rate_hz, struct runner **out,
                      struct error *err) {
    char hz[16];
    snprintf(hz, sizeof hz, "%g", rate_hz);
    const struct device_option options[LINES][OPTIONS_MAX] = {
        [MODBUS_TCP] = {{"driver", "modbus"},
                        {"address", m->modbus_tcp},
                        {"rate_hz", hz},
                        {"flexion", "1 0.01"},
                        {"sequence", "0"}},
        [MODBUS_RTU] = {{"driver", "modbus"},
                        {"serial", m->serial},
                        {"rate_hz", hz},
                        {"flexion", "1 0.01"},
                        {"sequence", "0"}},
        [TRACKER] = {{"driver", "tracker"}, {"address", m->tracker}, {"tool.probe", "probe"}},
        [HID] = {{"driver", "hid"},
                 {"vid", "1209"},
                 {"pid", "0001"},
                 {"serial", m->hid},
                 {"on_change", "no"},
                 {"punch.opening", "1:0 16 0 10000"}},
        [RECORDED] = {{"driver", "recorded"}, {"file", m->motion}},
        [SIMULATED] = {{"driver", "simulated"}, {"rate_hz", hz}},
    };
    struct device_config config = {.options = options[line]};
    while (config.option_count < OPTIONS_MAX && options[line][config.option_count].key)
        config.option_count++;
    snprintf(config.name, sizeof config.name, "%s", line_name(line));
    return runner_create(&config, 1, out, err);
}

// Those that the arguments name, all where they name none; a handle only where it can be made.
static enum result choose(const struct bench_options *options, bool chosen[LINES],
                          struct report *report, struct error *err) {
    const char *without_hid = mockup_without_hid();
    for (int i = 0; i < options->input_count; i++) {
        int line = 0;
        while (line < LINES && strcmp(options->inputs[i], line_name(line)) != 0)
            line++;
        if (line == LINES)
            return fail(err, RESULT_INVALID, "no line is named %s", options->inputs[i]);
        chosen[line] = true;
    }
    for (int i = 0; i < LINES && !options->input_count; i++)
        chosen[i] = true;
    if (chosen[HID] && without_hid) {
        char text[64];
        snprintf(text, sizeof text, "skipped: %s", without_hid);
        report_text(report, line_name(HID), text);
        chosen[HID] = false;
    }
    return RESULT_OK;
}

// ---- from the device to the datagram ------------------------------------------------------------

struct lane {
    struct runner *runner; // NULL: not chosen
    struct seal *seal;
    int64_t newest_ns;
    int values;
    struct samples latency_us;
};

static enum result open_lanes(const struct mockup *m, const bool chosen[LINES], struct lane *lanes,
                              struct error *err) {
    static const uint8_t key[SEAL_KEY_SIZE], iv[SEAL_IV_SIZE];
    enum result result = RESULT_OK;
    for (int i = 0; i < LINES && result == RESULT_OK; i++) {
        if (!chosen[i])
            continue;
        lanes[i].seal = seal_create(SEAL_TO_SERVER, 0, 1, key, iv);
        result = line_open(m, (enum line)i, device_hz, &lanes[i].runner, err);
    }
    return result;
}

// As a station does: collect, encode, seal. Counts what is new in it.
static void make_datagram(struct lane *lane, uint64_t number) {
    uint8_t bytes[WIRE_DATAGRAM_MAX - SEAL_OVERHEAD], datagram[WIRE_DATAGRAM_MAX];
    struct frame frame = {.number = number, .time_ns = clock_now_ns()};
    arthron_Frame message;
    size_t size;
    runner_collect(lane->runner, frame.time_ns, &frame);
    wire_frame_from(&frame, &message);
    wire_frame_pad(&message);
    CHECK(wire_encode_frame(&message, bytes, sizeof bytes, &size) == RESULT_OK);
    seal_seal(lane->seal, bytes, size, datagram);
    int64_t newest_ns = frame.samples[0].time_ns;
    if (newest_ns == lane->newest_ns)
        return;
    lane->newest_ns = newest_ns;
    lane->values++;
    samples_add(&lane->latency_us, (double)(clock_now_ns() - newest_ns) / 1e3);
}

static void report_lane(struct lane *lane, enum line line, double seconds, struct report *report) {
    const char *name = line_name(line);
    struct samples *l = &lane->latency_us;
    double asked_hz = line == RECORDED ? MOTION_HZ : device_hz;
    report_figure(report, asked_hz, "values/s", "%s/rate_asked", name);
    report_figure(report, lane->values / seconds, "values/s", "%s/rate", name);
    report_figure(report, samples_quantile(l, 0.5), "us", "%s/to_datagram/p50", name);
    report_figure(report, samples_quantile(l, 0.99), "us", "%s/to_datagram/p99", name);
    report_figure(report, samples_max(l), "us", "%s/to_datagram/max", name);
}

static enum result bench_rates(const bool chosen[LINES], double seconds, struct report *report,
                               struct error *err) {
    struct lane lanes[LINES] = {0};
    struct mockup mockup;
    enum result result = mockup_start("", device_hz, &mockup, err);
    if (result != RESULT_OK)
        return result;
    result = open_lanes(&mockup, chosen, lanes, err);
    int64_t start_ns = clock_now_ns() + NS_PER_S / 2; // all are connected by then
    uint64_t ticks = result == RESULT_OK ? (uint64_t)(seconds * loop_hz) : 0;
    for (uint64_t i = 1; i <= ticks; i++) {
        sleep_until(start_ns + (int64_t)((double)i / loop_hz * NS_PER_S));
        for (int k = 0; k < LINES; k++)
            if (chosen[k])
                make_datagram(&lanes[k], i);
    }
    for (int i = 0; i < LINES; i++) {
        if (result == RESULT_OK && chosen[i])
            report_lane(&lanes[i], (enum line)i, seconds, report);
        runner_destroy(&lanes[i].runner);
        if (lanes[i].seal)
            seal_destroy(&lanes[i].seal);
        samples_fini(&lanes[i].latency_us);
    }
    mockup_end(&mockup);
    return result;
}

// ---- noise --------------------------------------------------------------------------------------

// Recordings, each at several rates, of which any pose is taken for noise; and how much of 2 mm of
// noise is noticed at the least.
static void bench_noise(struct report *report) {
    static struct noise_row rows[NOISE_ROWS];
    const char *data = getenv("ARTHRON_DATA");
    int count = noise_table(data ? data : DATA, rows), false_flags = 0;
    double least = 1;
    if (!count) {
        report_text(report, "noise", "skipped: the recordings are not there");
        return;
    }
    for (int i = 0; i < count; i++) {
        false_flags += rows[i].clean > 0;
        least = fmin(least, rows[i].noisy);
    }
    report_mark(report, "noise_recordings", count, "recordings at a rate", NOISE_ROWS, BETTER_HIGH);
    report_mark(report, "noise_noticed_share_min", least, "1", 0.5, BETTER_HIGH);
    report_mark(report, "false_noise_flags", false_flags, "recordings", 0, BETTER_LOW);
}

enum result bench_devices(const struct bench_options *options, struct report *report,
                          struct error *err) {
    bool chosen[LINES] = {false};
    enum result result = choose(options, chosen, report, err);
    if (result == RESULT_OK)
        result = bench_rates(chosen, options->quick ? 1.5 : 10, report, err);
    if (result == RESULT_OK)
        result = bench_slaves(chosen, options->quick, report, err);
    bench_noise(report);
    bool any = false;
    for (int i = 0; i < MOCKUP_LINES; i++)
        any |= chosen[i];
    if (result != RESULT_OK || !any)
        return result;
    bool timed = chosen[MODBUS_TCP] && chosen[TRACKER];
    struct bench_time *time = timed ? bench_time_start(options->quick) : NULL;
    struct bench_out *out = options->input_count ? NULL : bench_out_start(options->quick);
    result = bench_faults(chosen, options->quick, report, err);
    enum result of_time = time ? bench_time_end(&time, report, err) : RESULT_OK;
    enum result of_out = out ? bench_out_end(&out, report, err) : RESULT_OK;
    if (result == RESULT_OK)
        result = of_time;
    return result == RESULT_OK ? of_out : result;
}
