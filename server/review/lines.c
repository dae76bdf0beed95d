#include "review/lines.h"

#include "base/clock.h"
#include "trace/player.h"
#include "trace/state_session.h"

#include <math.h>

#define A_LITTLE 1e-12 // of the whole, a few nanoseconds of an hour

struct moment {
    double order; // 0 to 1
    double s;     // since the first step
};

static void lines_init(struct report_lines *lines) {
    lines->joint_joined = false;
    thin_init(&lines->flexion);
    thin_init(&lines->varus);
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        lines->tips[i].joined = false;
        for (int k = 0; k < TIP_LINE_COUNT; k++)
            thin_init(&lines->tips[i].lines[k]);
        lines->forces[i].joined = lines->forces[i].any = false;
        thin_init(&lines->forces[i].line);
    }
    for (int i = 0; i < TISSUES_MAX; i++) {
        lines->tissues[i].landed = false;
        for (int k = 0; k < TISSUE_LINE_COUNT; k++)
            thin_init(&lines->tissues[i].lines[k]);
    }
}

static void add_tip(struct tip_lines *tip, struct moment at, const struct session_output *output,
                    const struct instrument_output *o) {
    struct thin *lines = tip->lines;
    vec3 hand = pose_apply_inverse(output->T_mockup_body[BODY_FEMUR], o->T_mockup_tip.translation);
    vec3 seen =
        pose_apply_inverse(output->T_mockup_virtual[BODY_FEMUR], o->T_mockup_warped.translation);
    thin_add(&lines[TIP_CORONAL_HAND], at.order, hand.x, hand.z);
    thin_add(&lines[TIP_CORONAL_SEEN], at.order, seen.x, seen.z);
    thin_add(&lines[TIP_SAGITTAL_HAND], at.order, hand.y, hand.z);
    thin_add(&lines[TIP_SAGITTAL_SEEN], at.order, seen.y, seen.z);
    thin_add(&lines[TIP_OFFSET], at.order, at.s, o->discrepancy.offset_mm);
    thin_add(&lines[TIP_GAIN], at.order, at.s, o->discrepancy.gain);
    thin_add(&lines[TIP_GAIN_LEAST], at.order, at.s, o->discrepancy.gain_least);
    thin_add(&lines[TIP_TURN], at.order, at.s, o->discrepancy.turn_deg);
    thin_add(&lines[TIP_TILT], at.order, at.s, o->discrepancy.tilt_deg);
}

static void break_tip(struct tip_lines *tip, double order) {
    for (int i = 0; tip->joined && i < TIP_LINE_COUNT; i++)
        thin_break(&tip->lines[i], order);
    tip->joined = false;
}

static void break_force(struct force_lines *force, double order) {
    if (force->joined)
        thin_break(&force->line, order);
    force->joined = false;
}

static void add_force(struct force_lines *force, struct moment at, const struct gauge *gauge) {
    if (!gauge->known || gauge->validity != VALIDITY_OK) {
        break_force(force, at.order);
        return;
    }
    thin_add(&force->line, at.order, at.s, gauge->force_n);
    force->joined = force->any = true;
}

static void break_joint(struct report_lines *lines, double order) {
    if (lines->joint_joined) {
        thin_break(&lines->flexion, order);
        thin_break(&lines->varus, order);
    }
    lines->joint_joined = false;
}

static void add_joint(struct report_lines *lines, struct moment at,
                      const struct session_output *output) {
    if (output->joint_validity == VALIDITY_LOST) {
        break_joint(lines, at.order);
        return;
    }
    thin_add(&lines->flexion, at.order, at.s, output->joint.flexion_deg);
    thin_add(&lines->varus, at.order, at.s, output->joint.varus_deg);
    lines->joint_joined = true;
}

// A staircase: figures stay until the next job lands.
static void add_landing(struct tissue_lines *t, struct moment at, const struct tissue_figures *f) {
    const double now[TISSUE_LINE_COUNT] = {[TISSUE_VOLUME] = f->volume_mm3,
                                           [TISSUE_TOUCHED_UNSEEN] = f->touched_unseen_mm3,
                                           [TISSUE_SEEN_UNTOUCHED] = f->seen_untouched_mm3};
    for (int i = 0; i < TISSUE_LINE_COUNT; i++) {
        if (t->landed)
            thin_add(&t->lines[i], at.order - A_LITTLE, at.s, t->last[i]);
        thin_add(&t->lines[i], at.order, at.s, now[i]);
        t->last[i] = now[i];
    }
    t->landed = true;
}

static void add_step(struct report_lines *lines, struct moment at,
                     const struct session_output *output) {
    add_joint(lines, at, output);
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        if (output->instruments[i].present) {
            add_tip(&lines->tips[i], at, output, &output->instruments[i]);
            lines->tips[i].joined = true;
        } else {
            break_tip(&lines->tips[i], at.order);
        }
    }
    if (output->landed.job)
        add_landing(&lines->tissues[output->landed.tissue], at, &output->landed.figures);
}

struct lines_reader {
    struct report_lines *lines;
    struct metrics *metrics;
    int64_t first_ns;
    double all_s;
    struct moment at;
};

static bool on_lines_step(void *user, const struct trace_record *record) {
    struct lines_reader *r = user;
    r->at.s = (double)(record->output.time_ns - r->first_ns) / (double)NS_PER_S;
    r->at.order = r->at.s / r->all_s;
    metrics_step(r->metrics, &record->input, &record->output);
    add_step(r->lines, r->at, &record->output);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        add_force(&r->lines->forces[i], r->at, &r->metrics->instruments[i].gauge);
    return true;
}

static bool on_elsewhere(void *user, const struct trace_record *record) {
    struct lines_reader *r = user;
    metrics_pass(r->metrics, record->input.kind, &record->output.landed,
                 record->output.job.kind == JOB_UNDO);
    return true;
}

// Of a state that cannot be read, nothing is told.
static bool on_lines_state(void *user, const struct trace_state *state) {
    struct lines_reader *r = user;
    struct kept kept = state_section(state, STATE_METRICS);
    metrics_take_over(r->metrics, &kept);
    return true;
}

// The server was killed: what was between is not known.
static bool on_lines_resume(void *user, int64_t utc_ns) {
    struct lines_reader *r = user;
    (void)utc_ns;
    metrics_interrupt(r->metrics);
    break_joint(r->lines, r->at.order + A_LITTLE);
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        break_tip(&r->lines->tips[i], r->at.order + A_LITTLE);
        break_force(&r->lines->forces[i], r->at.order + A_LITTLE);
    }
    return true;
}

enum result report_lines_read(struct trace_reader *reader, const struct survey *survey,
                              survey_progress progress, struct report_lines *lines,
                              struct metrics *metrics, struct error *err) {
    struct lines_reader r = {.lines = lines,
                             .metrics = metrics,
                             .first_ns = survey->first_ns,
                             .all_s = fmax(survey_seconds(survey), 1e-9)};
    struct trace_player player = {.user = &r,
                                  .step = on_lines_step,
                                  .past = on_elsewhere,
                                  .taken = on_elsewhere,
                                  .state = on_lines_state,
                                  .resume = on_lines_resume,
                                  .progress = progress};
    lines_init(lines);
    if (trace_play(reader, &player, err) == RESULT_IO)
        return RESULT_IO;
    for (int i = 0; i < TISSUES_MAX; i++) {
        struct tissue_lines *t = &lines->tissues[i];
        for (int k = 0; t->landed && k < TISSUE_LINE_COUNT; k++)
            thin_add(&t->lines[k], 1, survey_seconds(survey), t->last[k]);
    }
    return RESULT_OK;
}
