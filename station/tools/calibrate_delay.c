#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "calibrate/delay.h"
#include "drivers/options.h"
#include "tools/calibrate.h"

#include <stdio.h>
#include <stdlib.h>

#define DELAY_SAMPLES_MAX 100000
#define SETTLE_S 3 // until the offset of a tracker's clock is known

// Joint and tool, while a person moves both.
static enum result take_motion(struct station_config *config,
                               const struct calibrate_arguments *arguments,
                               struct gather_wish wishes[2], struct error *err) {
    struct gather *gather = NULL;
    enum result result = gather_create_all(config, &gather, err);
    if (result != RESULT_OK)
        return result;
    fprintf(
        stderr,
        "Fix the %s to the bone that moves. Now bend and stretch the knee quickly, for %.0f s.\n",
        channel_name(arguments->channel), SETTLE_S + arguments->seconds);
    result = gather_take_both(gather, wishes, SETTLE_S, err);
    wishes[0].count = wishes[1].count = 0;
    if (result == RESULT_OK)
        result = gather_take_both(gather, wishes, arguments->seconds, err);
    gather_destroy(&gather);
    return result;
}

static enum result fit(const struct gather_wish wishes[2], struct delay_fit *out,
                       struct error *err) {
    const struct gather_wish *joint = &wishes[0], *tool = &wishes[1];
    struct delay_flexion *flexions = alloc((size_t)joint->count + 1, sizeof *flexions);
    struct delay_turn *turns = alloc((size_t)tool->count + 1, sizeof *turns);
    for (int i = 0; i < joint->count; i++)
        flexions[i] =
            (struct delay_flexion){joint->samples[i].time_ns, joint->samples[i].joint.flexion_deg};
    for (int i = 0; i < tool->count; i++)
        turns[i] =
            (struct delay_turn){tool->samples[i].time_ns, tool->samples[i].T_mockup_body.rotation};
    enum result result = delay_calibrate(flexions, joint->count, turns, tool->count, out, err);
    free(flexions);
    free(turns);
    return result;
}

// What the config and the file say so far, by device.
static void read_delays(const struct station_config *config, double out_ms[STATION_DEVICES_MAX]) {
    for (int i = 0; i < config->device_count; i++) {
        const char *text = option_text(&config->devices[i].config, "delay_ms");
        out_ms[i] = text ? strtod(text, NULL) : 0;
    }
}

static void name_device(const struct station_config *config, const struct gather_wish *wish,
                        struct calibration_entry *entry) {
    snprintf(entry->device, sizeof entry->device, "%s",
             config->devices[wish->samples->device].config.name);
}

// The joint's delay stays, and the tool's is what it comes later than that. Only where that is
// negative, the joint gets more, and the tool none.
static enum result describe_delay(struct station_config *config, const struct gather_wish wishes[2],
                                  const double delays_ms[STATION_DEVICES_MAX],
                                  const struct delay_fit *fit, struct calibration_entry *out,
                                  json_t *report, struct error *err) {
    double tool_ms = fit->delay_ms + delays_ms[wishes[0].samples->device];
    bool tool_is_late = tool_ms >= 0;
    name_device(config, &wishes[tool_is_late], out);
    out->delay_ms = tool_is_late ? tool_ms : -fit->delay_ms;
    out->residual = fit->residual_deg;
    snprintf(out->details, sizeof out->details,
             "the %s comes %.1f ms after the %s, known to %.1f ms; flexion over %.0f degrees, at "
             "%.0f degrees a second",
             channel_name(wishes[fit->delay_ms >= 0].channel), fabs(fit->delay_ms),
             channel_name(wishes[fit->delay_ms < 0].channel), 2 * fit->uncertainty_ms,
             fit->range_deg, fit->speed_deg_s);
    json_object_set_new(report, "late_device", json_string(out->device));
    json_object_set_new(report, "delay_ms", json_real(out->delay_ms));
    json_object_set_new(report, "uncertainty_ms", json_real(fit->uncertainty_ms));
    if (tool_is_late)
        return RESULT_OK;
    struct calibration_entry tool = *out;
    name_device(config, &wishes[1], &tool);
    tool.delay_ms = 0;
    tool.utc_s = clock_utc_ns() / NS_PER_S;
    log_warning("station",
                "the joint is the late one: calibrate the delays of other trackers again");
    return calibration_put(&config->calibration, &tool)
               ? RESULT_OK
               : fail(err, RESULT_LIMIT, "%s: the file has no room for another part",
                      config->calibration_path);
}

enum result calibrate_delay(struct station_config *config,
                            const struct calibrate_arguments *arguments,
                            struct calibration_entry *out, json_t *report, struct error *err) {
    struct gather_wish wishes[2] = {{CHANNEL_JOINT, SAMPLE_JOINT, NULL, DELAY_SAMPLES_MAX, 0},
                                    {arguments->channel, SAMPLE_POSE, NULL, DELAY_SAMPLES_MAX, 0}};
    struct delay_fit found;
    double delays_ms[STATION_DEVICES_MAX];
    for (int i = 0; i < 2; i++)
        wishes[i].samples = alloc(DELAY_SAMPLES_MAX, sizeof *wishes[i].samples);
    enum result result = station_config_calibrate(config, err);
    read_delays(config, delays_ms);
    if (result == RESULT_OK)
        result = take_motion(config, arguments, wishes, err);
    if (result == RESULT_OK)
        result = fit(wishes, &found, err);
    if (result == RESULT_OK)
        result = describe_delay(config, wishes, delays_ms, &found, out, report, err);
    for (int i = 0; i < 2; i++)
        free(wishes[i].samples);
    return result;
}
