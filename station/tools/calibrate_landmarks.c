#include "base/number.h"
#include "calibrate/landmarks.h"
#include "tools/calibrate.h"

#include <stdio.h>
#include <string.h>

#define POINTS_MAX 32
#define LANDMARK_HOLD_S 1.0
#define SAMPLES_MAX 2000
#define MOVED_MAX_MM 1.0
#define RESIDUAL_MAX_MM 3.0

struct points {
    int count;
    char names[POINTS_MAX][32];
    vec3 in_mockup[POINTS_MAX], in_tracker[POINTS_MAX];
    double residuals_mm[POINTS_MAX];
};

static bool take_point(void *target, const char *name, const char *value) {
    struct points *points = target;
    pose at;
    if (points->count == POINTS_MAX || !number_pose(value, &at) ||
        !setting_text(name, points->names[points->count], sizeof points->names[0]))
        return false;
    points->in_mockup[points->count++] = at.translation;
    return true;
}

static void *find_points(void *user, const char *name, struct error *err) {
    (void)name, (void)err;
    return user;
}

// NAME = x y z, in mm, in the mock-up's frame.
static const struct setting_key point_keys[] = {
    {"*", .take = take_point, .wanted = "x y z in mm, of a name of at most 31 bytes, 32 in all"},
    {0},
};
static const struct setting_section landmark_sections[] = {{"landmarks", point_keys, find_points}, {0}};

static vec3 mean_of(const struct sample *samples, int count, double *out_rms_mm) {
    vec3 mean = {0};
    double sum = 0;
    for (int i = 0; i < count; i++)
        mean = vec3_add_scaled(mean, 1.0 / count, samples[i].T_mockup_body.translation);
    for (int i = 0; i < count; i++) {
        double off = vec3_distance(samples[i].T_mockup_body.translation, mean);
        sum += off * off;
    }
    *out_rms_mm = sqrt(sum / count);
    return mean;
}

static enum result touch(struct gather *gather, enum channel channel, const char *name,
                         vec3 *out_point, struct error *err) {
    static struct sample samples[SAMPLES_MAX];
    char text[128];
    int count;
    double moved_mm;
    snprintf(text, sizeof text, "Hold the tip of the %s still on %s", channel_name(channel), name);
    do {
        enum result result = gather_prompt(text, err);
        if (result == RESULT_OK)
            result = gather_take(gather, channel, SAMPLE_POSE, LANDMARK_HOLD_S, samples,
                                 SAMPLES_MAX, &count, err);
        if (result != RESULT_OK)
            return result;
        *out_point = mean_of(samples, count, &moved_mm);
        if (moved_mm > MOVED_MAX_MM)
            fprintf(stderr, "The tip moved by %.1f mm. Hold it still and repeat.\n", moved_mm);
    } while (moved_mm > MOVED_MAX_MM);
    return RESULT_OK;
}

static enum result touch_all(struct station_config *config,
                             const struct calibrate_arguments *arguments, struct points *points,
                             struct error *err) {
    struct gather *gather = NULL;
    enum result result = gather_create(config, arguments->device, &gather, err);
    for (int i = 0; i < points->count && result == RESULT_OK; i++)
        result = touch(gather, arguments->channel, points->names[i], &points->in_tracker[i], err);
    gather_destroy(&gather);
    return result;
}

static int worst_of(const struct points *points) {
    int worst = 0;
    for (int i = 1; i < points->count; i++)
        if (points->residuals_mm[i] > points->residuals_mm[worst])
            worst = i;
    return worst;
}

static enum result judge_landmarks(const struct points *points, const struct registration *found,
                                   struct calibration_entry *out, json_t *report,
                                   struct error *err) {
    int worst = worst_of(points);
    json_t *residuals = json_object();
    for (int i = 0; i < points->count; i++)
        json_object_set_new(residuals, points->names[i], json_real(points->residuals_mm[i]));
    json_object_set_new(report, "landmarks_mm", residuals);
    out->T_mockup_tracker = found->T_a_b;
    out->residual = found->rms_mm;
    snprintf(out->details, sizeof out->details, "%d landmarks, largest residual %.2f mm at %s",
             points->count, found->max_mm, points->names[worst]);
    if (found->max_mm > RESIDUAL_MAX_MM)
        return fail(err, RESULT_INVALID,
                    "%s is %.1f mm off. Check the point that you touched, the tip's calibration "
                    "and the points file",
                    points->names[worst], found->max_mm);
    return RESULT_OK;
}

enum result calibrate_landmarks(struct station_config *config,
                                const struct calibrate_arguments *arguments,
                                struct calibration_entry *out, json_t *report, struct error *err) {
    static struct points points;
    struct registration found;
    enum result result = settings_load(arguments->points, NULL, 0, landmark_sections, &points, err);
    if (result == RESULT_OK)
        result = station_config_calibrate(config, err);
    if (result != RESULT_OK)
        return result;
    station_config_set(config, arguments->device, "T_mockup_tracker", NULL);
    result = touch_all(config, arguments, &points, err);
    if (result == RESULT_OK)
        result = landmarks_register(points.in_mockup, points.in_tracker, points.count, &found,
                                    points.residuals_mm, err);
    return result == RESULT_OK ? judge_landmarks(&points, &found, out, report, err) : result;
}
