#include "base/check.h"
#include "base/log.h"
#include "calibrate/delay.h"
#include "tools/calibrate.h"

#include <stdio.h>
#include <stdlib.h>

#define SAMPLES_MAX 100000
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

// The later of the two devices gets the delay.
static void describe(const struct station_config *config, const struct gather_wish wishes[2],
                     const struct delay_fit *fit, struct calibration_entry *out, json_t *report) {
    bool tool_is_late = fit->delay_ms >= 0;
    const struct sample *of_late = wishes[tool_is_late].samples;
    const char *device = config->devices[of_late->device].config.name;
    snprintf(out->device, sizeof out->device, "%s", device);
    out->delay_ms = fabs(fit->delay_ms);
    out->residual = fit->residual_deg;
    snprintf(out->details, sizeof out->details,
             "%.1f ms later than the %s, known to %.1f ms; flexion over %.0f degrees, at %.0f "
             "degrees a second",
             out->delay_ms, tool_is_late ? "joint" : channel_name(wishes[1].channel),
             2 * fit->uncertainty_ms, fit->range_deg, fit->speed_deg_s);
    json_object_set_new(report, "late_device", json_string(device));
    json_object_set_new(report, "delay_ms", json_real(out->delay_ms));
    json_object_set_new(report, "uncertainty_ms", json_real(fit->uncertainty_ms));
}

enum result calibrate_delay(struct station_config *config,
                            const struct calibrate_arguments *arguments,
                            struct calibration_entry *out, json_t *report, struct error *err) {
    struct gather_wish wishes[2] = {{CHANNEL_JOINT, SAMPLE_JOINT, NULL, SAMPLES_MAX, 0},
                                    {arguments->channel, SAMPLE_POSE, NULL, SAMPLES_MAX, 0}};
    struct delay_fit found;
    for (int i = 0; i < 2; i++)
        wishes[i].samples = alloc(SAMPLES_MAX, sizeof *wishes[i].samples);
    enum result result = station_config_calibrate(config, err);
    if (result == RESULT_OK)
        result = take_motion(config, arguments, wishes, err);
    if (result == RESULT_OK) {
        result = fit(wishes, &found, err);
        if (result == RESULT_OK)
            describe(config, wishes, &found, out, report);
    }
    for (int i = 0; i < 2; i++)
        free(wishes[i].samples);
    return result;
}
