#include "metrics_play.h"

#include "base/check.h"
#include "base/clock.h"
#include "drivers/recording.h"
#include "random.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PROBE (CHANNEL_PROBE - CHANNEL_FIRST_INSTRUMENT)
#define SCOPE (CHANNEL_SCOPE - CHANNEL_FIRST_INSTRUMENT)
#define LATER_S 5.0
#define NOISE_MM 0.1
#define DROPPED_SHARE 0.05

// ---- whose hands --------------------------------------------------------------------------------

static void take_recording(const struct recording *recording, struct hands_at_work *out) {
    const struct recording_state *states = recording->tools[0].states;
    out->row_count = recording->row_count;
    out->rows = alloc((size_t)out->row_count, sizeof *out->rows);
    for (int i = 0; i < out->row_count; i++) {
        struct hands_row *row = &out->rows[i];
        row->t_seconds = recording->t_seconds[i] - recording->t_seconds[0];
        row->valid[PROBE] = states[i].valid;
        row->T_mockup_tip[PROBE] = states[i].pose;
        int later = recording_row_at(recording, recording->t_seconds[i] + LATER_S);
        bool there = recording->t_seconds[later] + 1 > recording->t_seconds[i] + LATER_S;
        row->valid[SCOPE] = there && states[later].valid;
        row->T_mockup_tip[SCOPE] = states[later].pose;
        row->T_mockup_tip[SCOPE].translation.x *= -1;
    }
}

enum result hands_recorded(const char *file, struct hands_at_work *out, struct error *err) {
    const char *data = getenv("ARTHRON_DATA");
    char path[512];
    struct recording recording;
    memset(out, 0, sizeof *out);
    snprintf(out->name, sizeof out->name, "%s", file);
    snprintf(path, sizeof path, "%s/tracker/%s.csv", data ? data : DATA, file);
    enum result result = recording_read(path, CHANNEL_PROBE, &recording, err);
    if (result == RESULT_OK)
        take_recording(&recording, out);
    recording_fini(&recording);
    return result;
}

void hands_of_motion(const struct motion *motion, const struct scene *scene, const char *name,
                     struct hands_at_work *out) {
    memset(out, 0, sizeof *out);
    snprintf(out->name, sizeof out->name, "%s", name);
    out->scene = scene;
    out->row_count = (int)motion->row_count;
    out->rows = alloc(motion->row_count, sizeof *out->rows);
    for (int i = 0; i < out->row_count; i++) {
        const struct motion_row *from = &motion->rows[i];
        struct hands_row *row = &out->rows[i];
        row->t_seconds = from->t_seconds;
        row->joint = from->joint;
        for (int k = 0; k < motion->tool_count; k++) {
            int instrument = (int)motion->tools[k].channel - CHANNEL_FIRST_INSTRUMENT;
            row->valid[instrument] = true;
            row->T_mockup_tip[instrument] = from->tools[k].T_mockup_tip;
        }
    }
}

void hands_at_work_fini(struct hands_at_work *hands) {
    free(hands->rows);
    hands->rows = NULL;
}

// ---- measured -----------------------------------------------------------------------------------

static bool is_lost(enum worse worse, uint64_t seed, int row, struct random *r) {
    if (worse == WORSE_RATE)
        return row % 2 != (int)(seed % 2);
    return worse == WORSE_DROPPED && random_between(r, 0, 1) < DROPPED_SHARE;
}

static void add_sample(struct frame *frame, struct sample sample) {
    sample.time_ns = frame->time_ns;
    frame->samples[frame->count++] = sample;
}

// Noise is of the tips; the joint's encoders have none.
static void measure(const struct hands_row *row, enum worse worse, uint64_t seed, int number,
                    struct random *r, struct frame *out) {
    out->number = (uint64_t)number + 1;
    out->time_ns = (int64_t)((1 + row->t_seconds) * NS_PER_S);
    out->count = 0;
    add_sample(
        out, (struct sample){.channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT, .joint = row->joint});
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        if (!row->valid[i] || is_lost(worse, seed, number, r))
            continue;
        struct sample sample = {.channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + i),
                                .kind = SAMPLE_POSE,
                                .T_mockup_body = row->T_mockup_tip[i]};
        vec3 noise = {random_normal(r), random_normal(r), random_normal(r)};
        if (worse == WORSE_NOISE)
            sample.T_mockup_body.translation =
                vec3_add_scaled(sample.T_mockup_body.translation, NOISE_MM, noise);
        add_sample(out, sample);
    }
}

// ---- scored -------------------------------------------------------------------------------------

// A step where no virtual patient is: shown where it is, for as long as a session would hold it.
static void step_without_scene(const struct session_input *input, struct sample *newest,
                               struct session_output *out) {
    int64_t hold_ns = session_settings_default().hold_ns;
    memset(out, 0, sizeof *out);
    out->state = SESSION_RUNNING;
    out->time_ns = input->time_ns;
    for (int i = 0; input->kind == INPUT_FRAME && i < input->frame.count; i++)
        newest[input->frame.samples[i].channel] = input->frame.samples[i];
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct sample *s = &newest[CHANNEL_FIRST_INSTRUMENT + i];
        if (s->kind == SAMPLE_POSE && out->time_ns - s->time_ns <= hold_ns)
            out->instruments[i] =
                (struct instrument_output){.present = true,
                                           .T_mockup_tip = s->T_mockup_body,
                                           .T_mockup_warped = s->T_mockup_body,
                                           .warp = {.nearest = -1, .nearest_mm = INFINITY},
                                           .discrepancy = {.gain = 1, .gain_least = 1}};
    }
}

static void keep(void *context, const struct metric_value *value) {
    struct figures *figures = context;
    CHECK(figures->count < FIGURES_MAX);
    figures->values[figures->count++] = *value;
}

void hands_play(const struct hands_at_work *hands, enum worse worse, uint64_t seed,
                struct figures *out) {
    struct session_settings settings = session_settings_default();
    struct session *session = hands->scene ? session_create(hands->scene, &settings) : NULL;
    struct random r = {seed};
    struct sample newest[CHANNEL_COUNT] = {0};
    struct metrics *metrics = alloc(1, sizeof *metrics);
    metrics_init(metrics, instruments_usual(), view_optic_usual());
    int64_t taken_ns = 0;
    for (int i = -1; i < hands->row_count; i++) {
        struct session_input input = {.kind = i < 0 ? INPUT_START : INPUT_FRAME,
                                      .time_ns = NS_PER_S};
        struct session_output output;
        if (i >= 0) {
            measure(&hands->rows[i], worse, seed, i, &r, &input.frame);
            input.time_ns = input.frame.time_ns;
        }
        if (session)
            session_step(session, &input, &output);
        else
            step_without_scene(&input, newest, &output);
        int64_t begin_ns = clock_now_ns();
        metrics_step(metrics, &input, &output);
        taken_ns += clock_now_ns() - begin_ns;
    }
    out->step_ns = (double)taken_ns / (hands->row_count + 1);
    out->count = 0;
    metrics_each(metrics, NULL, keep, out);
    if (session)
        session_destroy(&session);
    free(metrics);
}
