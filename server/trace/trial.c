#include "trace/trial.h"

#include "trace/player.h"

#include <string.h>

static void add_side(const struct instrument_output *o, struct trial_side *side) {
    if (!o->present)
        return;
    side->steps++;
    side->offset_mm += o->discrepancy.offset_mm; // the sum, until the end
    side->noticed += discrepancy_is_noticed(&o->discrepancy);
    side->penetration_mm = fmax(side->penetration_mm, o->penetration_mm);
}

static void compare_instrument(const struct instrument_output *recorded,
                               const struct instrument_output *tried,
                               struct trial_instrument *out) {
    add_side(recorded, &out->recorded);
    add_side(tried, &out->tried);
    if (!recorded->present || !tried->present)
        return;
    double mm =
        vec3_distance(recorded->T_mockup_warped.translation, tried->T_mockup_warped.translation);
    out->both++;
    out->mean_mm += mm;
    out->most_mm = fmax(out->most_mm, mm);
}

static void take_landed(const struct landed *landed, struct tissue_figures *figures) {
    if (landed->job)
        figures[landed->tissue] = landed->figures;
}

static void compare(const struct session_output *recorded, const struct session_output *tried,
                    struct trial_report *report) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        compare_instrument(&recorded->instruments[i], &tried->instruments[i],
                           &report->instruments[i]);
    for (int i = 0; i < EVENT_COUNT; i++) {
        report->events_recorded[i] += recorded->events >> i & 1;
        report->events_tried[i] += tried->events >> i & 1;
    }
    take_landed(&recorded->landed, report->recorded);
}

static void end_side(struct trial_side *side) {
    double steps = fmax(1, (double)side->steps);
    side->offset_mm /= steps;
    side->noticed /= steps;
}

static void end_means(struct trial_report *report) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        struct trial_instrument *o = &report->instruments[i];
        end_side(&o->recorded);
        end_side(&o->tried);
        o->mean_mm /= fmax(1, (double)o->both);
    }
}

struct trial {
    struct trial_report *report;
    struct rerun *rerun;
    int64_t first_ns;
    bool gap; // steps after it are not tried
};

static bool on_trial_step(void *user, const struct trace_record *record) {
    struct trial *trial = user;
    struct trial_report *report = trial->report;
    struct session_output output;
    struct landed landed;
    if (trial->gap) {
        report->left_out++;
        return true;
    }
    rerun_step_freely(trial->rerun, record, &output, &landed);
    take_landed(&landed, report->tried);
    take_landed(&output.landed, report->tried);
    if (record->type == TRACE_STEP)
        compare(&record->output, &output, report);
    trial->first_ns = report->steps++ == 0 ? record->input.time_ns : trial->first_ns;
    report->session_ns = record->input.time_ns - trial->first_ns;
    return true;
}

static bool on_trial_gap(void *user, uint64_t missing) {
    struct trial *trial = user;
    trial->gap = true;
    trial->report->left_out += missing;
    return true;
}

enum result trace_trial(struct trace_reader *reader, const struct scene *scene,
                        const struct session_settings *settings,
                        void (*progress)(uint64_t done, uint64_t all),
                        struct trial_report *out_report, struct error *err) {
    if (trace_reader_header(reader)->version < 3)
        return fail(err, RESULT_VERSION, "a trace of version 2 has no figures to compare with");
    if (trace_reader_header(reader)->part > 1)
        return fail(err, RESULT_REFUSED,
                    "a later part of a session begins with its state, which knows no other "
                    "settings and no other case");
    memset(out_report, 0, sizeof *out_report);
    out_report->tissue_count = scene_tissue_count(scene);
    struct trial trial = {.report = out_report, .rerun = rerun_create(scene, settings)};
    struct trace_player player = {.user = &trial,
                                  .step = on_trial_step,
                                  .past = on_trial_step,
                                  .gap = on_trial_gap,
                                  .progress = progress};
    out_report->end = trace_play(reader, &player, &out_report->why);
    rerun_destroy(&trial.rerun);
    end_means(out_report);
    return RESULT_OK;
}
