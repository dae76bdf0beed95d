// Devices: how fast each driver is, and what a station makes of each fault.
#include "devices.h"

#include "base/check.h"
#include "base/clock.h"
#include "bench.h"
#include "samples.h"
#include "wire/seal.h"
#include "wire/wire.h"

#include <stdio.h>
#include <string.h>

enum { DRIVERS = 5 };
static const double device_hz = 500, loop_hz = 1000;

enum result runner_of(const char *name, const struct device_option *options, int count,
                      struct runner **out, struct error *err) {
    struct device_config config = {.options = options, .option_count = count};
    snprintf(config.name, sizeof config.name, "%s", name);
    return runner_create(&config, 1, out, err);
}

// ---- from the device to the datagram ----

struct lane {
    const char *name;
    struct runner *runner;
    struct seal *seal;
    int64_t newest_ns;
    int values;
    struct samples latency_us;
};

static enum result open_lanes(const struct mockup *m, struct lane *lanes, struct error *err) {
    char hz[16];
    snprintf(hz, sizeof hz, "%g", device_hz);
    const struct device_option options[DRIVERS][5] = {
        {{"driver", "modbus"},
         {"address", m->modbus_tcp},
         {"rate_hz", hz},
         {"flexion", "1 0.01"},
         {"sequence", "0"}},
        {{"driver", "modbus"},
         {"serial", m->serial},
         {"rate_hz", hz},
         {"flexion", "1 0.01"},
         {"sequence", "0"}},
        {{"driver", "tracker"}, {"address", m->tracker}, {"tool.probe", "probe"}},
        {{"driver", "recorded"}, {"file", m->motion}},
        {{"driver", "simulated"}, {"rate_hz", hz}},
    };
    static const char *const names[DRIVERS] = {"modbus-tcp", "modbus-rtu", "tracker", "recorded",
                                               "simulated"};
    static const int counts[DRIVERS] = {5, 5, 3, 2, 2};
    static const uint8_t key[SEAL_KEY_SIZE], iv[SEAL_IV_SIZE];
    enum result result = RESULT_OK;
    for (int i = 0; i < DRIVERS && result == RESULT_OK; i++) {
        lanes[i].name = names[i];
        lanes[i].seal = seal_create(SEAL_TO_SERVER, 0, 1, key, iv);
        result = runner_of(names[i], options[i], counts[i], &lanes[i].runner, err);
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

static void report_lane(struct lane *lane, double seconds, struct report *report) {
    struct samples *l = &lane->latency_us;
    report_figure(report, lane->values / seconds, "values/s", "%s/rate", lane->name);
    report_figure(report, samples_quantile(l, 0.5), "us", "%s/to_datagram/p50", lane->name);
    report_figure(report, samples_quantile(l, 0.99), "us", "%s/to_datagram/p99", lane->name);
    report_figure(report, samples_max(l), "us", "%s/to_datagram/max", lane->name);
}

static enum result bench_rates(double seconds, struct report *report, struct error *err) {
    struct lane lanes[DRIVERS] = {0};
    struct mockup mockup;
    enum result result = mockup_start("", device_hz, &mockup, err);
    if (result != RESULT_OK)
        return result;
    result = open_lanes(&mockup, lanes, err);
    int64_t start_ns = clock_now_ns() + NS_PER_S / 2; // all are connected by then
    uint64_t ticks = result == RESULT_OK ? (uint64_t)(seconds * loop_hz) : 0;
    for (uint64_t i = 1; i <= ticks; i++) {
        sleep_until(start_ns + (int64_t)((double)i / loop_hz * NS_PER_S));
        for (int k = 0; k < DRIVERS; k++)
            make_datagram(&lanes[k], i);
    }
    for (int i = 0; i < DRIVERS; i++) {
        if (result == RESULT_OK)
            report_lane(&lanes[i], seconds, report);
        runner_destroy(&lanes[i].runner);
        if (lanes[i].seal)
            seal_destroy(&lanes[i].seal);
        samples_fini(&lanes[i].latency_us);
    }
    mockup_end(&mockup);
    return result;
}

enum result bench_devices(const struct bench_options *options, struct report *report,
                          struct error *err) {
    enum result result = bench_rates(options->quick ? 1.5 : 10, report, err);
    return result == RESULT_OK ? bench_faults(options->quick, report, err) : result;
}
