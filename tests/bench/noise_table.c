#include "noise_table.h"

#include "base/clock.h"
#include "drivers/recording.h"
#include "random.h"
#include "samples/noise.h"
#include "samples/slot.h"

#include <stdio.h>

enum { POSES_MAX = 1500 };

static const double noise_mm = 2;

// Share of the poses; those that the source calls lost are left out.
static double share_flagged(const struct recording *r, double rate_hz, double sigma_mm) {
    struct noise noise = {0};
    struct random random = {7};
    double last_s = r->t_seconds[r->row_count - 1];
    int flagged = 0, count = 0;
    for (int i = 0; i < POSES_MAX && r->t_seconds[0] + i / rate_hz <= last_s; i++) {
        double t = r->t_seconds[0] + i / rate_hz;
        struct recording_state s = recording_tool_at(r, 0, t);
        vec3 *at = &s.pose.translation;
        if (!s.valid)
            continue;
        at->x += sigma_mm * random_normal(&random);
        at->y += sigma_mm * random_normal(&random);
        at->z += sigma_mm * random_normal(&random);
        flagged += noise_is_high(&noise, SLOT_NOISE_MM, SLOT_NOISE_DEG,
                                 (int64_t)((t + 1) * NS_PER_S), s.pose);
        count++;
    }
    return count ? flagged / (double)count : 0;
}

int noise_table(const char *data, struct noise_row out_rows[NOISE_ROWS]) {
    static const char *const files[] = {
        "em_watertank_probe.csv",      "em_watertank_probe_raw_timestamps.csv",
        "stylus_landmarks.csv",        "stylus_landmarks_reference.csv",
        "optical50_probe.csv",         "nwire_probe.csv",
        "mocap100_handheld_fr1xyz.csv"};
    static const double rates_hz[] = {10, 12, 15, 20, 30, 60, 100, 300};
    int count = 0;
    for (size_t f = 0; f < sizeof files / sizeof *files; f++) {
        struct recording r;
        char path[512];
        snprintf(path, sizeof path, "%s/tracker/%s", data, files[f]);
        bool is_there = recording_read(path, CHANNEL_PROBE, &r, NULL) == RESULT_OK;
        for (size_t i = 0; is_there && i < sizeof rates_hz / sizeof *rates_hz; i++)
            out_rows[count++] =
                (struct noise_row){files[f], rates_hz[i], share_flagged(&r, rates_hz[i], 0),
                                   share_flagged(&r, rates_hz[i], noise_mm)};
        recording_fini(&r);
    }
    return count;
}
