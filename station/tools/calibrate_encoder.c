#include "calibrate/encoder.h"
#include "tools/calibrate.h"

#include <stdio.h>
#include <string.h>

#define ENCODER_HOLD_S 0.5
#define SAMPLES_MAX 2000
#define RMS_MAX 2.0
// The register is read as counts / 1000, so that every count is an angle that a sample may have.
#define COUNT_SCALE 0.001

static bool value_of(const struct joint_angles *joint, const char *key, double *out_value) {
    const struct {
        const char *key;
        double value;
    } values[] = {
        {"flexion", joint->flexion_deg},   {"varus", joint->varus_deg},
        {"internal", joint->internal_deg}, {"shift", joint->shift_mm},
        {"drawer", joint->drawer_mm},      {"distraction", joint->distraction_mm},
    };
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        if (!strcmp(values[i].key, key)) {
            *out_value = values[i].value;
            return true;
        }
    return false;
}

static enum result read_counts(struct gather *gather, const char *key, double known,
                               double *out_counts, struct error *err) {
    static struct sample samples[SAMPLES_MAX];
    char text[128];
    int count;
    snprintf(text, sizeof text, "Bring %s to %g", key, known);
    enum result result = gather_prompt(text, err);
    if (result == RESULT_OK)
        result = gather_take(gather, CHANNEL_JOINT, SAMPLE_JOINT, ENCODER_HOLD_S, samples,
                             SAMPLES_MAX, &count, err);
    if (result != RESULT_OK)
        return result;
    *out_counts = 0;
    for (int i = 0; i < count; i++) {
        double value = 0;
        value_of(&samples[i].joint, key, &value);
        *out_counts += value / COUNT_SCALE / count;
    }
    return RESULT_OK;
}

static enum result judge_encoder(const struct encoder_fit *fit, int count,
                                 struct calibration_entry *out, json_t *report, struct error *err) {
    const char *unit = calibration_is_angle(out) ? "degrees" : "mm";
    out->scale = fit->scale;
    out->offset = fit->offset;
    out->residual = fit->rms;
    snprintf(out->details, sizeof out->details, "%d known values, largest residual %.2f %s", count,
             fit->max, unit);
    json_object_set_new(report, "scale", json_real(fit->scale));
    json_object_set_new(report, "offset", json_real(fit->offset));
    if (fit->rms > RMS_MAX)
        return fail(err, RESULT_INVALID,
                    "the readings lie %.1f %s (root mean square) off a straight line. Repeat the "
                    "calibration",
                    fit->rms, unit);
    return RESULT_OK;
}

enum result calibrate_encoder(struct station_config *config,
                              const struct calibrate_arguments *arguments,
                              struct calibration_entry *out, json_t *report, struct error *err) {
    struct joint_angles none = {0};
    double value, counts[CALIBRATE_VALUES_MAX];
    struct gather *gather = NULL;
    struct encoder_fit fit;
    if (!value_of(&none, arguments->key, &value))
        return fail(err, RESULT_INVALID, "--key %s: the joint has no such value", arguments->key);
    snprintf(out->of, sizeof out->of, "%s", arguments->key);
    enum result result =
        station_config_scale(config, arguments->device, arguments->key, COUNT_SCALE, 0, err);
    if (result == RESULT_OK)
        result = gather_create(config, arguments->device, &gather, err);
    for (int i = 0; i < arguments->value_count && result == RESULT_OK; i++)
        result = read_counts(gather, arguments->key, arguments->values[i], &counts[i], err);
    gather_destroy(&gather);
    if (result == RESULT_OK)
        result = encoder_calibrate(counts, arguments->values, arguments->value_count, &fit, err);
    return result == RESULT_OK ? judge_encoder(&fit, arguments->value_count, out, report, err)
                               : result;
}
