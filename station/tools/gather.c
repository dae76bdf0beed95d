#include "tools/gather.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const struct timespec look_again = {0, 1000000};

struct gather {
    struct runner *runner;
};

static void take_as_it_is(struct station_config *config, const char *device) {
    station_config_set(config, device, "filter", NULL);
    station_config_set(config, device, "jump_mm", "10000");
    station_config_set(config, device, "jump_deg", "180");
}

static enum result start_gather(const struct device_config *devices, int count,
                                struct gather **out_gather, struct error *err) {
    struct gather *gather = alloc(1, sizeof *gather);
    enum result result = runner_create(devices, count, &gather->runner, err);
    if (result == RESULT_OK)
        *out_gather = gather;
    else
        free(gather);
    return result;
}

enum result gather_create(struct station_config *config, const char *name,
                          struct gather **out_gather, struct error *err) {
    struct station_device *device = station_config_device(config, name);
    if (!device)
        return fail(err, RESULT_MISSING, "the config has no [device %s]", name);
    take_as_it_is(config, name);
    return start_gather(&device->config, 1, out_gather, err);
}

enum result gather_create_all(struct station_config *config, struct gather **out_gather,
                              struct error *err) {
    struct device_config devices[STATION_DEVICES_MAX];
    for (int i = 0; i < config->device_count; i++) {
        take_as_it_is(config, config->devices[i].config.name);
        station_config_set(config, config->devices[i].config.name, "delay_ms", NULL);
        devices[i] = config->devices[i].config;
    }
    return start_gather(devices, config->device_count, out_gather, err);
}

void gather_destroy(struct gather **gather) {
    if (!*gather)
        return;
    runner_destroy(&(*gather)->runner);
    free(*gather);
    *gather = NULL;
}

static const struct sample *find(const struct frame *frame, enum channel channel,
                                 enum sample_kind kind) {
    for (int i = 0; i < frame->count; i++)
        if (frame->samples[i].channel == channel && frame->samples[i].kind == kind)
            return &frame->samples[i];
    return NULL;
}

static enum result explain(struct gather *gather, const struct gather_wish *wish,
                           struct error *err) {
    struct frame frame = {.count = 0};
    runner_newest(gather->runner, clock_now_ns(), &frame);
    const struct sample *sample = find(&frame, wish->channel, wish->kind);
    if (!sample)
        return fail(err, RESULT_MISSING, "the config has no device that gives %s",
                    channel_name(wish->channel));
    struct device_status status;
    runner_status(gather->runner, sample->device, &status);
    if (status.problem[0])
        return fail(err, RESULT_TIMEOUT, "[device %s] %s", status.name, status.problem);
    return fail(err, RESULT_TIMEOUT,
                "[device %s] sends no value for %s. Bring it into view, or correct its name",
                status.name, channel_name(wish->channel));
}

// False: no device gives it.
static bool take_newest(const struct frame *frame, int64_t since_ns, struct gather_wish *wish) {
    const struct sample *sample = find(frame, wish->channel, wish->kind);
    if (sample && sample->validity == VALIDITY_OK && sample->time_ns > since_ns &&
        wish->count < wish->max &&
        (!wish->count || sample->time_ns > wish->samples[wish->count - 1].time_ns))
        wish->samples[wish->count++] = *sample;
    return sample;
}

static enum result take(struct gather *gather, struct gather_wish *wishes, int count,
                        double seconds, struct error *err) {
    int64_t start_ns = clock_now_ns(), end_ns = start_ns + (int64_t)(seconds * 1e9);
    bool given = true, full = false;
    for (int64_t now_ns = start_ns; now_ns < end_ns && given && !full; now_ns = clock_now_ns()) {
        struct frame frame = {.count = 0};
        runner_newest(gather->runner, now_ns, &frame);
        for (int i = 0; i < count; i++) {
            given &= take_newest(&frame, start_ns, &wishes[i]);
            full |= wishes[i].count == wishes[i].max;
        }
        nanosleep(&look_again, NULL);
    }
    for (int i = 0; i < count; i++)
        if (!wishes[i].count)
            return explain(gather, &wishes[i], err);
    return RESULT_OK;
}

enum result gather_take(struct gather *gather, enum channel channel, enum sample_kind kind,
                        double seconds, struct sample *out, int max, int *out_count,
                        struct error *err) {
    struct gather_wish wish = {channel, kind, out, max, 0};
    enum result result = take(gather, &wish, 1, seconds, err);
    *out_count = wish.count;
    return result;
}

enum result gather_take_both(struct gather *gather, struct gather_wish wishes[2], double seconds,
                             struct error *err) {
    return take(gather, wishes, 2, seconds, err);
}

enum result gather_prompt(const char *text, struct error *err) {
    char line[256], question[256];
    snprintf(question, sizeof question, "%s, then press Enter: ", text);
    log_ask(question);
    bool answered = fgets(line, sizeof line, stdin);
    log_answered();
    if (answered)
        return RESULT_OK;
    return fail(err, RESULT_CLOSED, "the input ended before the calibration was complete");
}
