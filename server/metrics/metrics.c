#include "metrics/metrics.h"

#include "base/check.h"

#include <string.h>

void metrics_init(struct metrics *m, const struct instruments *tools, struct view_optic optic) {
    struct instruments of = *tools; // it may lie in *m
    CHECK(view_optic_is_valid(&optic));
    memset(m, 0, sizeof *m);
    m->optic = optic;
    m->tools = of;
    hands_init(&m->hands);
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        struct instrument_metrics *one = &m->instruments[i];
        one->newest_ns = -1;
        smooth_init(&one->hand_smooth);
        smooth_init(&one->seen_smooth);
        travel_init(&one->hand);
        travel_init(&one->seen);
        touch_init(&one->touch);
        search_init(&one->search);
    }
}

// ---- what stood since the step before -----------------------------------------------------------

static void pass_warp(struct instrument_metrics *one, const struct standing *s, int64_t passed_ns) {
    double share = (double)passed_ns / (double)(passed_ns + METRICS_NOTICE_NS);
    one->judged_ns += passed_ns;
    for (int i = 0; i < NOTICED_COUNT; i++) {
        one->felt[i] += share * (s->noticed[i] - one->felt[i]);
        if (one->felt[i] > 0.5)
            one->noticed_ns[i] += passed_ns;
    }
}

static void pass_instrument(struct instrument_metrics *one, const struct standing *s,
                            int64_t passed_ns) {
    if (!s->present)
        return;
    one->present_ns += passed_ns;
    touch_pass(&one->touch, s->nearest, s->penetration_mm, passed_ns);
    force_pass(one->touch.touching ? &one->pressed[s->nearest] : &one->free, &one->gauge,
               passed_ns);
    if (s->judged)
        pass_warp(one, s, passed_ns);
    if (!s->beside_scope)
        return;
    one->beside_scope_ns += passed_ns;
    if (!s->in_view)
        one->out_of_view_ns += passed_ns;
}

static void pass(struct metrics *m, int64_t time_ns) {
    int64_t passed_ns = time_ns - m->time_ns;
    if (!m->stepped || !m->running)
        return;
    m->running_ns += passed_ns;
    if (passed_ns > METRICS_STEP_MAX_NS)
        passed_ns = METRICS_STEP_MAX_NS;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        pass_instrument(&m->instruments[i], &m->standing[i], passed_ns);
    for (int i = 0; i < BODY_COUNT; i++)
        force_pass(&m->bones[i].pressed, &m->bones[i].gauge, passed_ns);
}

// The optic through which the trainee looks: the first that is there; -1: none.
static int scope_of(const struct metrics *m, const struct session_output *output) {
    for (int i = 0; i < m->tools.count; i++)
        if (m->tools.of[i].kind == INSTRUMENT_OPTIC && output->instruments[i].present)
            return i;
    return -1;
}

// ---- what stands from this step on --------------------------------------------------------------

static void stand(const struct metrics *m, const struct session_output *output, int instrument,
                  struct standing *out) {
    const struct instrument_output *o = &output->instruments[instrument];
    int scope = scope_of(m, output);
    const struct discrepancy *d = &o->discrepancy;
    memset(out, 0, sizeof *out);
    if (!o->present)
        return;
    out->present = true;
    out->nearest = o->warp.nearest;
    out->penetration_mm = o->penetration_mm;
    out->judged = d->gain > 0;
    out->noticed[NOTICED_TURNED] = d->turn_deg > NOTICED_TURN_DEG;
    out->noticed[NOTICED_TILTED] = d->tilt_deg > NOTICED_TURN_DEG;
    out->noticed[NOTICED_GAIN] = d->gain > NOTICED_GAIN_MOST || d->gain_least < NOTICED_GAIN_LEAST;
    out->noticed[NOTICED_ANY] = discrepancy_is_noticed(d);
    out->beside_scope = scope >= 0 && m->tools.of[instrument].kind != INSTRUMENT_OPTIC;
    out->in_view =
        out->beside_scope && view_shows(&m->optic, output->instruments[scope].T_mockup_warped,
                                        o->T_mockup_warped.translation);
}

// ---- forces -------------------------------------------------------------------------------------

static const struct sample *force_of(const struct session_input *input, enum channel channel) {
    if (input->kind != INPUT_FRAME)
        return NULL;
    for (int i = input->frame.count - 1; i >= 0; i--) {
        const struct sample *s = &input->frame.samples[i];
        if (s->kind == SAMPLE_FORCE && s->channel == channel)
            return s;
    }
    return NULL;
}

static void follow_forces(struct metrics *m, const struct session_input *input, int64_t time_ns) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        gauge_step(&m->instruments[i].gauge,
                   force_of(input, CHANNEL_FIRST_INSTRUMENT + (enum channel)i), time_ns);
    for (int i = 0; i < BODY_COUNT; i++)
        gauge_step(&m->bones[i].gauge, force_of(input, CHANNEL_FEMUR + (enum channel)i), time_ns);
}

// ---- motion -------------------------------------------------------------------------------------

// The newest good sample of an instrument's pose in a frame; NULL where there is none.
static const struct sample *sample_of(const struct session_input *input, int instrument) {
    if (input->kind != INPUT_FRAME)
        return NULL;
    for (int i = input->frame.count - 1; i >= 0; i--) {
        const struct sample *s = &input->frame.samples[i];
        if (s->kind == SAMPLE_POSE && s->validity != VALIDITY_LOST &&
            (int)s->channel == CHANNEL_FIRST_INSTRUMENT + instrument)
            return s;
    }
    return NULL;
}

static void follow_seen(struct instrument_metrics *one, int64_t time_ns, vec3 seen) {
    struct smooth_point points[SMOOTH_OUT_MAX];
    int count = smooth_feed(&one->seen_smooth, time_ns, seen, points);
    for (int i = 0; i < count; i++)
        travel_add(&one->seen, &points[i]);
}

// Times are those of the samples, for steps come late by as much as they like. One that is ahead of
// the step is clock error.
static void follow(struct metrics *m, int instrument, const struct sample *sample,
                   const struct session_output *output) {
    struct instrument_metrics *one = &m->instruments[instrument];
    const struct instrument_output *o = &output->instruments[instrument];
    struct smooth_point points[SMOOTH_OUT_MAX];
    vec3 hand = o->T_mockup_tip.translation, seen = o->T_mockup_warped.translation;
    int64_t time_ns = sample->time_ns < output->time_ns ? sample->time_ns : output->time_ns;
    if (time_ns <= one->newest_ns || !vec3_is_finite(hand) || !vec3_is_finite(seen))
        return;
    one->newest_ns = time_ns;
    one->samples++;
    int count = smooth_feed(&one->hand_smooth, time_ns, hand, points);
    for (int i = 0; i < count; i++) {
        travel_add(&one->hand, &points[i]);
        hands_move(&m->hands, instrument, points[i].cell, one->hand.speed);
    }
    follow_seen(one, time_ns, seen);
}

static void break_motion(struct instrument_metrics *one) {
    smooth_break(&one->hand_smooth);
    smooth_break(&one->seen_smooth);
}

// ---- the step -----------------------------------------------------------------------------------

static void step_instrument(struct metrics *m, int instrument, const struct session_input *input,
                            const struct session_output *output) {
    struct instrument_metrics *one = &m->instruments[instrument];
    struct standing *standing = &m->standing[instrument];
    const struct instrument_output *o = &output->instruments[instrument];
    stand(m, output, instrument, standing);
    touch_step(&one->touch, output->time_ns, o->present ? o->warp.nearest : -1, o->warp.nearest_mm);
    search_step(&one->search, output->time_ns, standing->beside_scope, standing->in_view);
    const struct sample *sample = sample_of(input, instrument);
    if (o->present && sample)
        follow(m, instrument, sample, output);
    if (output->state != SESSION_RUNNING)
        break_motion(one);
}

static void land(struct metrics *m, const struct landed *landed, bool is_undone) {
    if (!landed->job)
        return;
    m->tissues[landed->tissue] = landed->figures;
    m->resected[landed->tissue] = true;
    m->undone[landed->tissue] += is_undone;
}

void metrics_step(struct metrics *m, const struct session_input *input,
                  const struct session_output *output) {
    if (input->kind == INPUT_RESET && output->state != SESSION_CLOSED)
        metrics_init(m, &m->tools, m->optic);
    pass(m, output->time_ns);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        step_instrument(m, i, input, output);
    follow_forces(m, input, output->time_ns);
    land(m, &output->landed, output->events & EVENT_UNDONE);
    m->stepped = true;
    m->time_ns = output->time_ns;
    m->running = output->state == SESSION_RUNNING;
}

void metrics_pass(struct metrics *m, enum input_kind kind, const struct landed *landed,
                  bool is_undo) {
    if (kind == INPUT_RESET)
        metrics_init(m, &m->tools, m->optic);
    land(m, landed, is_undo && landed->outcome == JOB_DONE);
}

void metrics_interrupt(struct metrics *m) {
    m->stepped = false;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        struct instrument_metrics *one = &m->instruments[i];
        break_motion(one);
        search_step(&one->search, m->time_ns, false, false);
    }
}

bool metrics_take_over(struct metrics *m, struct kept *k) {
    struct metrics kept = *m;
    metrics_keep(&kept, k);
    if (k->bad || kept_left(k))
        return false;
    *m = kept;
    metrics_interrupt(m);
    return true;
}
