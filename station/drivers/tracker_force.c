#include "drivers/tracker_force.h"

#include "base/clock.h"
#include "base/log.h"
#include "base/number.h"
#include "drivers/drivers.h"
#include "drivers/options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// ---- config -------------------------------------------------------------------------------------

static const char *text_of(const struct device_config *config, const char *prefix,
                           enum channel channel, char key[64]) {
    snprintf(key, 64, "%s.%s", prefix, channel_name(channel));
    return option_text(config, key);
}

static bool parse_elements(const char *text, struct tracker_force *out) {
    double numbers[FORCE_PARTS_MAX];
    out->force.count = number_list(text, FORCE_PARTS_MAX, numbers);
    for (int i = 0; i < out->force.count; i++) {
        if (numbers[i] != floor(numbers[i]) || numbers[i] < 1 ||
            numbers[i] > IGTL_SENSOR_VALUES_MAX)
            return false;
        out->elements[i] = (int)numbers[i] - 1;
    }
    return out->force.count == 1 || out->force.count == FORCE_PARTS_MAX;
}

static enum result configure_one(const struct device_config *config, enum channel channel,
                                 struct tracker_force *f, struct error *err) {
    char key[64];
    const char *name = text_of(config, "force", channel, key);
    if (name && (!*name || strlen(name) >= sizeof f->device))
        return option_fail(config, key, err, RESULT_INVALID, "a name has 1 to %zu bytes",
                           sizeof f->device - 1);
    if (name && channel == CHANNEL_JOINT)
        return option_fail(config, key, err, RESULT_INVALID, "the joint has no force");
    strcpy(f->device, name ? name : "");
    f->force.count = name != NULL;
    const char *elements = text_of(config, "elements", channel, key);
    if (elements && !name)
        return option_fail(config, key, err, RESULT_INVALID, "the section has no force of it");
    if (elements && !parse_elements(elements, f))
        return option_fail(config, key, err, RESULT_INVALID,
                           "\"%s\" is neither one number from 1 to %d nor three", elements,
                           IGTL_SENSOR_VALUES_MAX);
    const char *scale = text_of(config, "scale", channel, key);
    if (scale && (!name || !number_double(scale, -1e9, 1e9, &f->scale) || f->scale == 0))
        return option_fail(config, key, err, RESULT_INVALID,
                           name ? "\"%s\" is not a number of newtons other than 0"
                                : "\"%s\": the section has no force of it",
                           scale);
    return force_read_zero(config, channel, &f->force, err);
}

enum result tracker_force_configure(const struct device_config *config,
                                    struct tracker_force out[CHANNEL_COUNT],
                                    struct device_outputs *outputs, struct error *err) {
    for (int c = 0; c < CHANNEL_COUNT; c++) {
        enum result result = configure_one(config, (enum channel)c, &out[c], err);
        if (result != RESULT_OK)
            return result;
        if (out[c].device[0])
            outputs_add(outputs, (enum channel)c, SAMPLE_FORCE);
    }
    return RESULT_OK;
}

// ---- messages -----------------------------------------------------------------------------------

void tracker_force_begin(struct tracker_force forces[CHANNEL_COUNT]) {
    for (int c = 0; c < CHANNEL_COUNT; c++) {
        forces[c].clock = (struct stamp_clock){0};
        forces[c].is_unstamped = false;
        forces[c].stamp_ns = forces[c].arrival_ns = 0;
    }
}

// What the message's numbers are in newtons.
static enum result read_parts(const struct tracker_force *f, const struct igtl_message *m,
                              double out_n[FORCE_PARTS_MAX], struct error *err) {
    double newtons = f->scale;
    if (newtons == 0 && igtl_unit_newtons(m->sensor.unit, &newtons, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "SENSOR of %s: ", f->device);
    for (int i = 0; i < f->force.count; i++) {
        if (f->elements[i] >= m->sensor.count)
            return fail(err, RESULT_FORMAT, "SENSOR of %s: it has %d numbers, and no number %d",
                        f->device, m->sensor.count, f->elements[i] + 1);
        out_n[i] = newtons * m->sensor.values[f->elements[i]];
        if (!isfinite(out_n[i]))
            return fail(err, RESULT_FORMAT, "SENSOR of %s: number %d is not finite", f->device,
                        f->elements[i] + 1);
    }
    return RESULT_OK;
}

static enum result check_force_stamp(struct tracker_force *f, const struct igtl_message *m,
                                     int64_t arrival_ns, struct error *err) {
    enum stamp_verdict verdict = stamp_judge(&f->clock, m->stamp_ns, arrival_ns);
    if (verdict == STAMP_GOOD)
        return RESULT_OK;
    if (verdict == STAMP_LATE)
        return fail(err, RESULT_FORMAT, "SENSOR of %s: it came %lld ms late", f->device,
                    (long long)(f->clock.lateness_ns / NS_PER_MS));
    return fail(err, RESULT_FORMAT, "SENSOR of %s: its clock was set", f->device);
}

static enum result take(struct tracker_force *f, enum channel channel, bool uses_stamps,
                        const struct igtl_message *m, int64_t arrival_ns,
                        struct device_reading *reading, struct error *err) {
    double parts_n[FORCE_PARTS_MAX] = {0};
    enum result result = read_parts(f, m, parts_n, err);
    if (result != RESULT_OK)
        return result;
    bool said_again = f->arrival_ns && f->stamp_ns == m->stamp_ns;
    if (said_again && arrival_ns - f->arrival_ns > STAMP_LATE_NS && !f->is_unstamped &&
        memcmp(f->parts_n, parts_n, sizeof parts_n) != 0) {
        log_warning("tracker", "SENSOR of %s: ignores its time stamps: they stand still",
                    f->device);
        f->is_unstamped = true;
    }
    bool stamped = uses_stamps && !f->is_unstamped && m->stamp_ns;
    if (stamped && (result = check_force_stamp(f, m, arrival_ns, err)) != RESULT_OK)
        return result;
    if (stamped && said_again)
        return RESULT_OK;
    f->stamp_ns = m->stamp_ns;
    f->arrival_ns = arrival_ns;
    memcpy(f->parts_n, parts_n, sizeof parts_n);
    const struct sample sample = {
        .channel = channel,
        .kind = SAMPLE_FORCE,
        .time_ns = stamped ? stamp_time(&f->clock, m->stamp_ns, arrival_ns) : arrival_ns,
        .force_n = force_of(&f->force, parts_n)};
    reading_put(reading, &sample);
    return RESULT_OK;
}

enum result tracker_force_take(struct tracker_force forces[CHANNEL_COUNT], bool uses_stamps,
                               const struct igtl_message *m, int64_t arrival_ns,
                               struct device_reading *reading, bool *out_is_ours,
                               struct error *err) {
    *out_is_ours = false;
    enum result result = RESULT_OK;
    for (int c = 0; c < CHANNEL_COUNT; c++) {
        if (!forces[c].device[0] || strcmp(m->device, forces[c].device) != 0)
            continue;
        *out_is_ours = true;
        if (take(&forces[c], (enum channel)c, uses_stamps, m, arrival_ns, reading, err) !=
            RESULT_OK)
            result = RESULT_FORMAT;
    }
    return result;
}
