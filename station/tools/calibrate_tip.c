#include "base/check.h"
#include "calibrate/pivot.h"
#include "tools/calibrate.h"

#include <stdio.h>
#include <stdlib.h>

#define POSES_MAX 20000
#define RMS_MAX_MM 2.0

static enum result take_poses(struct station_config *config,
                              const struct calibrate_arguments *arguments, pose *out_poses,
                              int *out_count, struct error *err) {
    struct gather *gather = NULL;
    struct sample *samples = alloc(POSES_MAX, sizeof *samples);
    enum result result = gather_create(config, arguments->device, &gather, err);
    if (result == RESULT_OK) {
        fprintf(stderr,
                "For %.0f s, keep the tip of the %s in a dimple. Swing the handle wide, forward, "
                "back and sideways.\n",
                arguments->seconds, channel_name(arguments->channel));
        result = gather_take(gather, arguments->channel, SAMPLE_POSE, arguments->seconds, samples,
                             POSES_MAX, out_count, err);
    }
    for (int i = 0; i < *out_count; i++)
        out_poses[i] = samples[i].T_mockup_body;
    gather_destroy(&gather);
    free(samples);
    return result;
}

static enum result judge_tip(const struct pivot *pivot, int count, struct calibration_entry *out,
                             json_t *report, struct error *err) {
    out->tip_mm = pivot->tip_mm;
    out->residual = pivot->rms_mm;
    snprintf(out->details, sizeof out->details, "%d poses, largest residual %.2f mm, turn %.0f deg",
             count, pivot->max_mm, pivot->turn_deg);
    json_object_set_new(report, "tip_mm",
                        json_pack("[f, f, f]", pivot->tip_mm.x, pivot->tip_mm.y, pivot->tip_mm.z));
    json_object_set_new(report, "max_mm", json_real(pivot->max_mm));
    json_object_set_new(report, "turn_deg", json_real(pivot->turn_deg));
    if (pivot->rms_mm > RMS_MAX_MM)
        return fail(
            err, RESULT_INVALID,
            "the tip moved by %.1f mm (root mean square). Press it into the dimple and repeat",
            pivot->rms_mm);
    return RESULT_OK;
}

enum result calibrate_tip(struct station_config *config,
                          const struct calibrate_arguments *arguments,
                          struct calibration_entry *out, json_t *report, struct error *err) {
    char key[64];
    int count = 0;
    struct pivot pivot;
    pose *poses = alloc(POSES_MAX, sizeof *poses);
    snprintf(key, sizeof key, "tip.%s", channel_name(arguments->channel));
    station_config_set(config, arguments->device, key, NULL);
    station_config_set(config, arguments->device, "T_mockup_tracker", NULL);
    snprintf(out->of, sizeof out->of, "%s", channel_name(arguments->channel));
    enum result result = take_poses(config, arguments, poses, &count, err);
    if (result == RESULT_OK)
        result = pivot_calibrate(poses, count, &pivot, err);
    if (result == RESULT_OK)
        result = judge_tip(&pivot, count, out, report, err);
    free(poses);
    return result;
}
