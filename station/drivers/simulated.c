// A knee that bends and a probe that wanders in front of it, with no hardware at all: sums of slow
// sines whose phases come from the seed.
//
//   seed      the same seed gives the same motion; 1
//   rate_hz   readings a second, 1 to 2000; 200
//   noise_mm  standard deviation of the probe's position, 0 to 10; 0

#include "base/check.h"
#include "base/clock.h"
#include "drivers/drivers.h"
#include "drivers/options.h"

#include <stdlib.h>

enum { SWINGS = 8 }; // two of the joint, three of the probe's place, three of its direction

struct simulated {
    uint64_t random;
    int64_t period_ns, start_ns, next_ns;
    double noise_mm;
    double phase[SWINGS], turns_per_s[SWINGS];
};

// splitmix64
static double uniform(struct simulated *d) {
    uint64_t z = (d->random += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

// Box and Muller
static double normal(struct simulated *d) {
    double u = 1 - uniform(d);
    return sqrt(-2 * log(u)) * cos(2 * M_PI * uniform(d));
}

static enum result simulated_create(const struct device_config *config, void **out_device,
                                    struct device_outputs *out_outputs, struct error *err) {
    static const char *const keys[] = {"seed", "rate_hz", "noise_mm", NULL};
    int seed = 0;
    double rate_hz, noise_mm;
    enum result result = options_check(config, keys, err);
    if (result == RESULT_OK)
        result = option_integer(config, "seed", 0, 1000000000, 1, &seed, err);
    if (result == RESULT_OK)
        result = option_number(config, "rate_hz", 1, 2000, 200, &rate_hz, err);
    if (result == RESULT_OK)
        result = option_number(config, "noise_mm", 0, 10, 0, &noise_mm, err);
    if (result != RESULT_OK)
        return result;
    struct simulated *d = alloc(1, sizeof *d);
    *d = (struct simulated){.random = (uint64_t)seed, .noise_mm = noise_mm};
    d->period_ns = (int64_t)(NS_PER_S / rate_hz);
    for (int i = 0; i < SWINGS; i++) {
        d->phase[i] = uniform(d);
        d->turns_per_s[i] = 0.1 + 0.2 * uniform(d);
    }
    outputs_add(out_outputs, CHANNEL_JOINT, SAMPLE_JOINT);
    outputs_add(out_outputs, CHANNEL_PROBE, SAMPLE_POSE);
    *out_device = d;
    return RESULT_OK;
}

static enum result simulated_open(void *device, struct error *err) {
    (void)err;
    struct simulated *d = device;
    d->start_ns = d->next_ns = clock_now_ns();
    return RESULT_OK;
}

static double swing(const struct simulated *d, int i, double seconds) {
    return sin(2 * M_PI * (d->phase[i] + d->turns_per_s[i] * seconds));
}

static struct joint_angles joint_at(const struct simulated *d, double s) {
    return (struct joint_angles){.flexion_deg = 45 + 40 * swing(d, 0, s),
                                 .varus_deg = 4 * swing(d, 1, s)};
}

static pose probe_at(struct simulated *d, double s) {
    vec3 place = {25 * swing(d, 2, s), 40 + 20 * swing(d, 3, s), 15 * swing(d, 4, s)};
    vec3 turn = {0.3 * swing(d, 5, s), 0.3 * swing(d, 6, s), 0.3 * swing(d, 7, s)};
    vec3 noise = {normal(d), normal(d), normal(d)};
    vec3 axis = vec3_unit_or(turn, (vec3){1, 0, 0});
    return (pose){quat_from_axis_angle(axis, vec3_length(turn)),
                  vec3_add_scaled(place, d->noise_mm, noise)};
}

static enum result simulated_poll(void *device, struct device_reading *reading, struct error *err) {
    (void)err;
    struct simulated *d = device;
    int64_t back_ns = d->next_ns - due_within(d->next_ns, d->period_ns);
    d->start_ns -= back_ns; // the clock went back
    d->next_ns -= back_ns;
    if (!wait_until(d->next_ns))
        return RESULT_OK;
    double seconds = (double)(d->next_ns - d->start_ns) / NS_PER_S;
    reading->count = 2;
    reading->samples[0] = (struct sample){.channel = CHANNEL_JOINT,
                                          .kind = SAMPLE_JOINT,
                                          .time_ns = d->next_ns,
                                          .joint = joint_at(d, seconds)};
    reading->samples[1] = (struct sample){.channel = CHANNEL_PROBE,
                                          .kind = SAMPLE_POSE,
                                          .time_ns = d->next_ns,
                                          .T_mockup_body = probe_at(d, seconds)};
    d->next_ns += d->period_ns;
    return RESULT_OK;
}

static void simulated_close(void *device) {
    (void)device;
}

const struct device_driver simulated_driver = {
    "simulated", simulated_create, simulated_open, simulated_poll, simulated_close, free,
};
