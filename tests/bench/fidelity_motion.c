// Recordings of hands, set down beside lesions: how much the warp changes from frame to frame.
#include "drivers/recording.h"
#include "fidelity.h"

#include <stdio.h>
#include <stdlib.h>

#define STARTS 40
#define STARTS_QUICK 10
#define ABOVE_MM 1.0 // of a surface, where a recording begins

static const char *const recordings[] = {"optical50_probe", "em_watertank_probe"};

struct frames {
    struct samples change, hand; // of W, and of the hand, in one frame, mm
};

static bool is_reached(const struct scene_of_lesion *scene, vec3 y) {
    return anatomy_reaches(&scene->anatomy->scene, scene->anatomy->hollow, y);
}

// From a row on as long as one can be there.
static void follow(const struct scene_of_lesion *scene, const struct recording *recording, int row,
                   vec3 start, struct frames of[VARIANT_COUNT]) {
    const struct recording_state *states = recording->tools[0].states;
    struct warp last[VARIANT_COUNT];
    vec3 before = start, origin = states[row].pose.translation;
    for (int v = 0; v < VARIANT_COUNT; v++)
        last[v] = variant_warp(scene->anatomy, (enum variant)v, start);
    for (int i = row + 1; i < recording->row_count && states[i].valid; i++) {
        vec3 y = vec3_add(start, vec3_sub(states[i].pose.translation, origin));
        if (!is_reached(scene, y))
            return;
        for (int v = 0; v < VARIANT_COUNT; v++) {
            struct warp warp = variant_warp(scene->anatomy, (enum variant)v, y);
            double change = vec3_distance(warp.displacement, last[v].displacement);
            samples_add(&of[v].change, change);
            samples_add(&of[v].hand, vec3_distance(y, before));
            last[v] = warp;
        }
        before = y;
    }
}

static void play(const struct scene_of_lesion *scene, const char *name,
                 const struct recording *recording) {
    struct frames of[VARIANT_COUNT] = {0};
    struct random r = {scene->seed};
    int starts = scene->fidelity->quick ? STARTS_QUICK : STARTS;
    for (int i = 0; i < starts; i++) {
        vec3 point, normal;
        int row = (int)(random_bits(&r) % (uint64_t)recording->row_count);
        if (!fidelity_place(scene, &r, &point, &normal) || !recording->tools[0].states[row].valid)
            continue;
        vec3 start = vec3_add_scaled(point, ABOVE_MM, normal);
        if (is_reached(scene, start))
            follow(scene, recording, row, start, of);
    }
    for (int v = 0; v < VARIANT_COUNT; v++) {
        char what[96];
        snprintf(what, sizeof what, "one frame of %s/change", name);
        fidelity_samples(scene, (enum variant)v, what, "mm", &of[v].change);
        snprintf(what, sizeof what, "one frame of %s/change over hand", name);
        fidelity_figure(scene, (enum variant)v, what, "times",
                        samples_mean(&of[v].change) / samples_mean(&of[v].hand));
        samples_fini(&of[v].change);
        samples_fini(&of[v].hand);
    }
}

void fidelity_motion(const struct scene_of_lesion *scene) {
    const char *data = getenv("ARTHRON_DATA");
    for (size_t i = 0; i < sizeof recordings / sizeof recordings[0]; i++) {
        char path[4096];
        struct recording recording;
        struct error err;
        snprintf(path, sizeof path, "%s/tracker/%s.csv", data ? data : DATA, recordings[i]);
        if (recording_read(path, CHANNEL_FIRST_INSTRUMENT, &recording, &err) == RESULT_OK)
            play(scene, recordings[i], &recording);
        else
            report_text(scene->fidelity->report, recordings[i], "skipped: no such recording here");
        recording_fini(&recording);
    }
}
