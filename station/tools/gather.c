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

enum result gather_create(struct station_config *config, const char *name,
                          struct gather **out_gather, struct error *err) {
    struct station_device *device = station_config_device(config, name);
    if (!device)
        return fail(err, RESULT_MISSING, "the config has no [device %s]", name);
    station_config_set(config, name, "filter", NULL);
    station_config_set(config, name, "jump_mm", "10000");
    struct gather *gather = alloc(1, sizeof *gather);
    enum result result = runner_create(&device->config, 1, &gather->runner, err);
    if (result != RESULT_OK) {
        free(gather);
        return result;
    }
    *out_gather = gather;
    return RESULT_OK;
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

static enum result explain(struct gather *gather, enum channel channel, struct error *err) {
    struct device_status status;
    runner_status(gather->runner, 0, &status);
    if (status.problem[0])
        return fail(err, RESULT_TIMEOUT, "[device %s] %s", status.name, status.problem);
    return fail(err, RESULT_TIMEOUT,
                "[device %s] sends no value for %s. Bring it into view, or correct its name",
                status.name, channel_name(channel));
}

enum result gather_take(struct gather *gather, enum channel channel, enum sample_kind kind,
                        double seconds, struct sample *out, int max, int *out_count,
                        struct error *err) {
    int64_t last_ns = clock_now_ns(), end_ns = last_ns + (int64_t)(seconds * 1e9);
    int count = 0;
    for (int64_t now_ns = last_ns; now_ns < end_ns && count < max; now_ns = clock_now_ns()) {
        struct frame frame = {.count = 0};
        runner_newest(gather->runner, now_ns, &frame);
        const struct sample *sample = find(&frame, channel, kind);
        if (!sample)
            break;
        if (sample->validity == VALIDITY_OK && sample->time_ns > last_ns) {
            out[count++] = *sample;
            last_ns = sample->time_ns;
        }
        nanosleep(&look_again, NULL);
    }
    *out_count = count;
    return count ? RESULT_OK : explain(gather, channel, err);
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
