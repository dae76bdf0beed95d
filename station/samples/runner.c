#include "samples/runner.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "drivers/drivers.h"
#include "drivers/edges.h"
#include "drivers/options.h"
#include "samples/runner_parts.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DRIVERS_MAX 16
#define ALL_VALUES 0x3f // of the joint
#define MARKERS_HZ 20
#define MARKERS_BURST 100
#define MARKERS_WAITING 128

static const int64_t first_pause_ns = 100 * NS_PER_MS, longest_pause_ns = 5 * NS_PER_S;

// ---- the thread of a device ---------------------------------------------------------------------

static bool stopping(struct device *d) {
    pthread_mutex_lock(&d->lock);
    bool stop = d->stop;
    pthread_mutex_unlock(&d->lock);
    return stop;
}

static void pause_before_open(struct device *d) {
    int64_t until = clock_now_ns() + d->pause_ns;
    struct timespec at = {until / NS_PER_S, until % NS_PER_S};
    pthread_mutex_lock(&d->lock);
    while (!d->stop && pthread_cond_timedwait(&d->wake, &d->lock, &at) != ETIMEDOUT)
        ;
    pthread_mutex_unlock(&d->lock);
    d->pause_ns = 2 * d->pause_ns < longest_pause_ns ? 2 * d->pause_ns : longest_pause_ns;
}

static void set_connected(struct device *d, bool connected, const struct error *err) {
    pthread_mutex_lock(&d->lock);
    bool changed = d->status.connected != connected || (!connected && !d->status.problem[0]);
    d->status.connected = connected;
    if (connected)
        d->status.reopenings += d->was_open;
    else
        strcpy(d->status.problem, err->text);
    pthread_mutex_unlock(&d->lock);
    d->was_open |= connected;
    if (connected)
        log_info("device", "%s: connected", d->status.name);
    else if (changed)
        log_warning("device", "%s: %s; trying again", d->status.name, err->text);
}

static bool open_device(struct device *d) {
    struct error err = {{0}};
    bool connected = d->driver->open(d->handle, &err) == RESULT_OK;
    set_connected(d, connected, &err);
    if (!connected)
        pause_before_open(d);
    return connected;
}

// A value that is not used is the device's problem: said by name, and why.
static void complain(struct device *d, const struct sample *sample, const char *why) {
    snprintf(d->status.problem, sizeof d->status.problem, "%s: %s", channel_name(sample->channel),
             why);
}

// True: it was used.
static bool take_sample(struct device *d, const struct sample *given, int64_t now_ns) {
    struct slot *slot = runner_slot(d, given);
    struct sample measured = *given, *sample = &measured;
    sample->time_ns -= d->delay_ns;
    switch (slot_take(slot, sample, now_ns)) {
    case SLOT_MALFORMED:
        d->status.malformed++;
        complain(d, sample, "a value out of range, or no newer than the last");
        return false;
    case SLOT_JUMP:
        d->status.jumps++;
        complain(d, sample, "jumped");
        return false;
    case SLOT_NOISY:
        d->status.noisy++;
        complain(d, sample, "shakes more than a hand can");
        return false;
    case SLOT_SILENT:
        complain(d, sample, "the device reports no value");
        return false;
    default:
        return true;
    }
}

// Channels that changed between being there and being lost since the last call.
static void log_changes(struct device *d) {
    bool lost[DEVICE_SAMPLES_MAX];
    char why[sizeof d->status.problem];
    pthread_mutex_lock(&d->lock);
    for (int i = 0; i < d->slot_count; i++)
        lost[i] = d->slots[i].validity == VALIDITY_LOST;
    strcpy(why, d->status.problem[0] ? d->status.problem : "the device sends nothing new");
    pthread_mutex_unlock(&d->lock);
    for (int i = 0; i < d->slot_count; i++) {
        const char *channel = channel_name(d->slots[i].newest.channel);
        if (lost[i] == d->logged_lost[i])
            continue;
        d->logged_lost[i] = lost[i];
        if (lost[i])
            log_warning("device", "%s: %s lost: %s", d->status.name, channel, why);
        else
            log_info("device", "%s: %s has values", d->status.name, channel);
    }
}

static void count_rate(struct device *d, bool reading, int64_t now_ns) {
    d->second_readings += reading;
    int64_t elapsed = now_ns - d->second_ns;
    if (elapsed < NS_PER_S)
        return;
    d->status.rate_hz = (double)d->second_readings * NS_PER_S / (double)elapsed;
    d->second_readings = 0;
    d->second_ns = now_ns;
}

// True: all were used.
static bool take_samples(struct device *d, const struct device_reading *reading, int64_t now_ns) {
    int used[DEVICE_SAMPLES_MAX] = {0}, all = 0;
    for (int i = 0; i < reading->count; i++)
        if (take_sample(d, &reading->samples[i], now_ns)) {
            used[runner_slot(d, &reading->samples[i]) - d->slots]++;
            all++;
        }
    for (int i = 0; i < d->slot_count; i++)
        if (used[i])
            slot_arrived(&d->slots[i], used[i], now_ns);
    return all == reading->count;
}

// A contact that flickers all the time must not fill the trace.
static void take_marker(struct device *d, const struct device_marker *given, int64_t now_ns) {
    struct marker marker = {.time_ns = given->time_ns - d->delay_ns, .value = given->value};
    snprintf(marker.name, sizeof marker.name, "%s", given->name);
    snprintf(marker.device, sizeof marker.device, "%s", d->status.name);
    d->status.markers++;
    if (!bucket_take(&d->marking, MARKERS_HZ, MARKERS_BURST, now_ns) ||
        !ring_push(d->markers, &marker))
        d->status.markers_lost++;
}

static void take_markers(struct device *d, const struct device_reading *reading, int64_t now_ns) {
    for (int i = 0; i < reading->marker_count; i++)
        take_marker(d, &reading->markers[i], now_ns);
    d->status.markers += (uint64_t)reading->markers_lost;
    d->status.markers_lost += (uint64_t)reading->markers_lost;
}

static void take_reading(struct device *d, enum result result, const struct device_reading *reading,
                         const struct error *err) {
    int64_t now_ns = clock_now_ns();
    pthread_mutex_lock(&d->lock);
    runner_age_slots(d, now_ns);
    bool all_used = take_samples(d, reading, now_ns);
    take_markers(d, reading, now_ns);
    bool heard = reading->count > 0 || (reading->heard && !d->slot_count);
    d->status.readings += heard;
    d->status.timeouts += result == RESULT_TIMEOUT;
    d->status.malformed += (uint64_t)reading->malformed;
    d->status.skipped += (uint64_t)reading->skipped;
    count_rate(d, heard, now_ns);
    if (result != RESULT_OK)
        strcpy(d->status.problem, err->text);
    else if (heard && all_used)
        d->status.problem[0] = 0;
    pthread_mutex_unlock(&d->lock);
}

// At most one line a second.
static void log_refusal(struct device *d, const struct error *err) {
    int64_t now_ns = clock_now_ns();
    if (now_ns - d->refusal_logged_ns < NS_PER_S)
        return;
    d->refusal_logged_ns = now_ns;
    log_warning("device", "%s: refused: %s", d->status.name, err->text);
}

static void read_device(struct device *d) {
    while (!stopping(d)) {
        struct device_reading reading = {0};
        struct error err = {{0}};
        enum result result = d->driver->poll(d->handle, &reading, &err);
        take_reading(d, result, &reading, &err);
        if (result == RESULT_FORMAT)
            log_refusal(d, &err);
        log_changes(d);
        if (reading.count || reading.heard)
            d->pause_ns = first_pause_ns;
        if (result == RESULT_OK || result == RESULT_TIMEOUT || result == RESULT_FORMAT)
            continue;
        set_connected(d, false, &err);
        break;
    }
    d->driver->close(d->handle);
}

static void *device_thread(void *argument) {
    struct device *d = argument;
    while (!stopping(d)) {
        if (!open_device(d))
            continue;
        read_device(d);
        if (!stopping(d))
            pause_before_open(d);
    }
    return NULL;
}

// ---- checking the configs -----------------------------------------------------------------------

static bool is_own_key(const char *key) {
    for (int i = 0; runner_keys[i]; i++)
        if (!strcmp(key, runner_keys[i]))
            return true;
    return false;
}

static enum result create_handle(struct device *d, const struct device_config *config,
                                 struct device_outputs *out_outputs, struct error *err) {
    struct device_option *options = alloc((size_t)config->option_count + 1, sizeof *options);
    struct device_config rest = *config;
    rest.options = options;
    rest.option_count = 0;
    for (int i = 0; i < config->option_count; i++)
        if (!is_own_key(config->options[i].key))
            options[rest.option_count++] = config->options[i];
    enum result result = d->driver->create(&rest, &d->handle, out_outputs, err);
    free(options);
    return result;
}

static enum result refuse_repeated_keys(const struct device_config *config, struct error *err) {
    for (int i = 0; i < config->option_count; i++)
        for (int k = 0; k < i; k++)
            if (!strcmp(config->options[i].key, config->options[k].key))
                return option_fail(config, config->options[i].key, err, RESULT_INVALID,
                                   "given twice");
    return RESULT_OK;
}

static enum result choose_driver(struct device *d, const struct device_config *config,
                                 const char *name, struct error *err) {
    const char *names[DRIVERS_MAX + 1] = {NULL};
    char text[64];
    d->driver = device_driver(name);
    if (d->driver)
        return RESULT_OK;
    for (int i = 0; device_drivers[i] && i < DRIVERS_MAX; i++)
        names[i] = device_drivers[i]->name;
    snprintf(text, sizeof text, "no driver is named \"%.32s\"", name);
    return option_fail_name(config, "driver", err, text, name, names);
}

// What each channel of a device is judged and smoothed by.
struct slot_settings {
    double delay_ms, hold_ms, jump_mm, jump_deg, noise_mm, noise_deg;
    struct filter_settings filter;
};

static enum result read_settings(const struct device_config *config, struct slot_settings *out,
                                 struct error *err) {
    const char *filter = option_text(config, "filter");
    *out = (struct slot_settings){.filter = {FILTER_NONE}};
    enum result result = option_number(config, "delay_ms", 0, 1000, 0, &out->delay_ms, err);
    if (result == RESULT_OK)
        result = option_number(config, "hold_ms", 0, 10000, 100, &out->hold_ms, err);
    if (result == RESULT_OK)
        result = option_number(config, "jump_mm", 1, 10000, SLOT_JUMP_MM, &out->jump_mm, err);
    if (result == RESULT_OK)
        result = option_number(config, "jump_deg", 1, 180, SLOT_JUMP_DEG, &out->jump_deg, err);
    if (result == RESULT_OK)
        result = option_number(config, "noise_mm", 0.01, 1000, SLOT_NOISE_MM, &out->noise_mm, err);
    if (result == RESULT_OK)
        result =
            option_number(config, "noise_deg", 0.01, 180, SLOT_NOISE_DEG, &out->noise_deg, err);
    if (result == RESULT_OK && filter && !filter_parse(filter, &out->filter))
        result = option_fail(config, "filter", err, RESULT_INVALID,
                             "\"%s\" is neither none nor one-euro MIN_CUTOFF_HZ BETA [DCUTOFF_HZ]",
                             filter);
    return result;
}

static void init_slots(struct device *d, const struct device_outputs *outputs, int index,
                       const struct slot_settings *settings) {
    d->slot_count = outputs->count;
    for (int i = 0; i < outputs->count; i++) {
        struct slot *slot = &d->slots[i];
        if (outputs->outputs[i].kind == SAMPLE_JOINT)
            d->joint_values =
                outputs->outputs[i].joint_values ? outputs->outputs[i].joint_values : ALL_VALUES;
        slot_init(slot, outputs->outputs[i].channel, outputs->outputs[i].kind, (uint8_t)index,
                  settings->hold_ms, settings->jump_mm);
        slot->guard.jump_rad = settings->jump_deg * RAD_PER_DEG;
        slot->noise_mm = settings->noise_mm;
        slot->noise_deg = settings->noise_deg;
        filter_init(&slot->filter, &settings->filter);
    }
}

static enum result configure(struct device *d, const struct device_config *config, int index,
                             struct error *err) {
    char driver[OPTION_TEXT_MAX];
    struct slot_settings settings;
    struct device_outputs outputs = {0};
    enum result result = refuse_repeated_keys(config, err);
    if (result == RESULT_OK)
        result = option_required(config, "driver", driver, err);
    if (result == RESULT_OK)
        result = read_settings(config, &settings, err);
    if (result == RESULT_OK)
        result = choose_driver(d, config, driver, err);
    if (result == RESULT_OK)
        result = create_handle(d, config, &outputs, err);
    if (result != RESULT_OK)
        return result;
    for (int i = 0; i < config->option_count; i++)
        d->has_markers |= edge_key(&config->options[i]) != NULL;
    d->markers = ring_create(MARKERS_WAITING, sizeof(struct marker));
    strcpy(d->status.name, config->name);
    d->status.driver = d->driver->name;
    d->status.filter = settings.filter.kind;
    d->status.hold_ms = settings.hold_ms;
    d->delay_ns = (int64_t)(settings.delay_ms * NS_PER_MS);
    init_slots(d, &outputs, index, &settings);
    return RESULT_OK;
}

// Several devices may give the joint, each other values of it.
static enum result refuse_shared_joint(const struct device *a, const struct device *b,
                                       struct error *err) {
    static const char *const names[] = {"flexion", "varus",  "internal",
                                        "shift",   "drawer", "distraction"};
    int shared = a->joint_values & b->joint_values, first = 0;
    if (!shared)
        return RESULT_OK;
    while (!(shared >> first & 1))
        first++;
    return fail(err, RESULT_INVALID, "[device %s] and [device %s]: both give %s of the joint",
                a->status.name, b->status.name, names[first]);
}

static enum result refuse_shared_channels(const struct device *a, const struct device *b,
                                          struct error *err) {
    if (!strcmp(a->status.name, b->status.name))
        return fail(err, RESULT_INVALID, "[device %s]: two devices have this name", a->status.name);
    if (refuse_shared_joint(a, b, err) != RESULT_OK)
        return RESULT_INVALID;
    for (int i = 0; i < a->slot_count; i++)
        for (int k = 0; k < b->slot_count; k++) {
            const struct sample *x = &a->slots[i].newest, *y = &b->slots[k].newest;
            if (x->channel == y->channel && x->kind == y->kind && x->kind != SAMPLE_JOINT)
                return fail(err, RESULT_INVALID,
                            "[device %s] and [device %s]: both give the %s of channel %s",
                            a->status.name, b->status.name,
                            x->kind == SAMPLE_POSE     ? "pose"
                            : x->kind == SAMPLE_HANDLE ? "handle"
                                                       : "force",
                            channel_name(x->channel));
        }
    return RESULT_OK;
}

static enum result configure_all(struct runner *r, const struct device_config *configs, int count,
                                 struct error *err) {
    int channels = 0;
    bool has_joint = false;
    if (count > RUNNER_DEVICES_MAX)
        return fail(err, RESULT_LIMIT, "the config has %d devices, more than %d", count,
                    RUNNER_DEVICES_MAX);
    for (; r->count < count; r->count++) {
        struct device *d = &r->devices[r->count];
        enum result result = configure(d, &configs[r->count], r->count, err);
        for (int i = 0; i < r->count && result == RESULT_OK; i++) {
            result = refuse_shared_channels(&r->devices[i], d, err);
            if (result != RESULT_OK) {
                d->driver->destroy(d->handle);
                ring_destroy(&d->markers);
            }
        }
        if (result != RESULT_OK)
            return result;
        channels += d->slot_count - (has_joint && d->joint_values);
        has_joint |= d->joint_values;
    }
    if (channels > FRAME_SAMPLES_MAX)
        return fail(err, RESULT_LIMIT, "the devices give %d channels, more than %d", channels,
                    FRAME_SAMPLES_MAX);
    return RESULT_OK;
}

// ---- the interface ------------------------------------------------------------------------------

static void start_device(struct device *d) {
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&d->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    pthread_mutex_init(&d->lock, NULL);
    d->pause_ns = first_pause_ns;
    for (int i = 0; i < d->slot_count; i++)
        d->logged_lost[i] = true;
    d->second_ns = clock_now_ns();
    NEED(pthread_create(&d->thread, NULL, device_thread, d) == 0, "thread");
}

enum result runner_create(const struct device_config *configs, int count,
                          struct runner **out_runner, struct error *err) {
    CHECK(count >= 0);
    struct runner *r = alloc(1, sizeof *r);
    r->pace_ns = INFINITY;
    enum result result = configure_all(r, configs, count, err);
    if (result != RESULT_OK) {
        runner_destroy(&r);
        return result;
    }
    for (; r->started < count; r->started++)
        start_device(&r->devices[r->started]);
    *out_runner = r;
    return RESULT_OK;
}

static void ask_to_stop(struct device *d) {
    pthread_mutex_lock(&d->lock);
    d->stop = true;
    pthread_cond_signal(&d->wake);
    pthread_mutex_unlock(&d->lock);
}

static void join_device(struct device *d) {
    pthread_join(d->thread, NULL);
    pthread_cond_destroy(&d->wake);
    pthread_mutex_destroy(&d->lock);
}

void runner_destroy(struct runner **runner) {
    struct runner *r = *runner;
    if (!r)
        return;
    for (int i = 0; i < r->started; i++)
        ask_to_stop(&r->devices[i]);
    for (int i = 0; i < r->started; i++)
        join_device(&r->devices[i]);
    for (int i = 0; i < r->count; i++) {
        r->devices[i].driver->destroy(r->devices[i].handle);
        ring_destroy(&r->devices[i].markers);
    }
    free(r);
    *runner = NULL;
}

bool runner_next_marker(struct runner *r, struct marker *out) {
    for (int i = 0; i < r->count; i++)
        if (ring_pop(r->devices[i].markers, out))
            return true;
    return false;
}

bool runner_has_markers(const struct runner *r) {
    for (int i = 0; i < r->count; i++)
        if (r->devices[i].has_markers)
            return true;
    return false;
}

int runner_count(const struct runner *runner) {
    return runner->count;
}

void runner_status(struct runner *r, int index, struct device_status *out_status) {
    CHECK(index >= 0 && index < r->count);
    struct device *d = &r->devices[index];
    pthread_mutex_lock(&d->lock);
    *out_status = d->status;
    for (int i = 0; i < d->slot_count; i++)
        out_status->filter_latency_ms =
            fmax(out_status->filter_latency_ms, 1e3 * d->slots[i].filter.latency_s);
    pthread_mutex_unlock(&d->lock);
}
