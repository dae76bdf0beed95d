#include "review/survey.h"

#include "base/clock.h"
#include "metrics/metrics.h"
#include "trace/player.h"
#include "trace/state_session.h"

#include <string.h>

static void count_input(const struct session_input *input, struct survey *s) {
    if (input->kind != INPUT_FRAME)
        return;
    s->frames++;
    for (int i = 0; i < input->frame.count; i++)
        s->lost_samples += input->frame.samples[i].validity == VALIDITY_LOST;
}

static void notice(const struct instrument_output *o, struct noticing *n) {
    const struct discrepancy *d = &o->discrepancy;
    n->turn += d->turn_deg > NOTICED_TURN_DEG;
    n->tilt += d->tilt_deg > NOTICED_TURN_DEG;
    n->gain += d->gain > NOTICED_GAIN_MOST || d->gain_least < NOTICED_GAIN_LEAST;
    n->any += discrepancy_is_noticed(d);
    n->worst.offset_mm = fmax(n->worst.offset_mm, d->offset_mm);
    n->worst.tilt_deg = fmax(n->worst.tilt_deg, d->tilt_deg);
    n->worst.turn_deg = fmax(n->worst.turn_deg, d->turn_deg);
    n->worst.gain = fmax(n->worst.gain, d->gain);
    n->worst.gain_least = fmin(n->worst.gain_least, d->gain_least);
    n->penetration_mm = fmax(n->penetration_mm, o->penetration_mm);
}

static void count_output(const struct session_output *output, struct survey *s) {
    if (s->steps++ == 0) {
        s->first_ns = s->last_ns = output->time_ns;
        s->begun_utc_ns = s->written_utc_ns;
    }
    s->written_utc_ns += output->time_ns - s->last_ns;
    if (output->state != SESSION_CLOSED)
        s->until_utc_ns = s->written_utc_ns;
    s->last_ns = output->time_ns;
    s->state = output->state;
    s->jobs += output->job.id != 0;
    if (output->landed.job)
        s->tissues[output->landed.tissue] = output->landed.figures;
    s->torn_count = output->torn_count;
    for (int i = 0; i < output->torn_count; i++)
        s->share[i] = fmax(s->share[i], output->share[i]);
    for (int i = 0; i < EVENT_COUNT; i++)
        s->events[i] += output->events >> i & 1;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        if (!output->instruments[i].present)
            continue;
        s->present[i]++;
        notice(&output->instruments[i], &s->noticing[i]);
        s->largest_mm = fmax(s->largest_mm, vec3_length(output->instruments[i].warp.displacement));
    }
}

// A remark's time is that at which it was made.
static void take_remark(const struct remark *remark, struct survey *s) {
    struct remark *kept = &s->remarks[remark->number - 1];
    int64_t time_ns = kept->number ? kept->time_ns : remark->time_ns;
    *kept = *remark;
    kept->time_ns = time_ns;
    if (remark->number > s->remark_count)
        s->remark_count = remark->number;
}

static void count_touch(const struct touch_change *touch, struct survey *s) {
    s->touches += touch != NULL;
    s->touch_bytes += touch ? touch->size : 0;
}

static bool on_survey_step(void *user, const struct trace_record *record) {
    count_input(&record->input, user);
    count_output(&record->output, user);
    count_touch(record->touch, user);
    return true;
}

static bool on_past(void *user, const struct trace_record *record) {
    struct survey *s = user;
    count_touch(record->touch, s);
    s->past++;
    return true;
}

static bool on_taken(void *user, const struct trace_record *record) {
    struct survey *s = user;
    const struct landed *landed = &record->output.landed;
    count_touch(record->touch, s);
    if (landed->job)
        s->tissues[landed->tissue] = landed->figures;
    s->taken++;
    return true;
}

static bool on_survey_state(void *user, const struct trace_state *state) {
    struct survey *s = user;
    struct metrics metrics;
    struct kept kept = state_section(state, STATE_METRICS);
    metrics_init(&metrics, instruments_usual(), view_optic_usual());
    if (metrics_take_over(&metrics, &kept))
        memcpy(s->tissues, metrics.tissues, sizeof s->tissues);
    s->state_step = state->place.step;
    return true;
}

static bool on_gap(void *user, uint64_t missing) {
    struct survey *s = user;
    s->gaps++;
    s->missing += missing;
    return true;
}

static bool on_survey_resume(void *user, int64_t utc_ns) {
    struct survey *s = user;
    s->written_utc_ns = utc_ns;
    s->resumes++;
    return true;
}

static bool on_fault(void *user, int64_t utc_ns) {
    struct survey *s = user;
    (void)utc_ns;
    s->faults++;
    return true;
}

static bool on_remark(void *user, const struct remark *remark) {
    take_remark(remark, user);
    return true;
}

static bool on_begun(void *user, const struct trace_attempt *begun) {
    struct survey *s = user;
    if (s->attempt_count < SURVEY_ATTEMPTS_MAX) {
        s->attempts[s->attempt_count] = (struct survey_attempt){.begun = *begun};
        s->attempts[s->attempt_count].begun.text = NULL;
    }
    s->attempt_count++;
    return true;
}

// Of one whose begin is lost nothing is told.
static bool on_ended(void *user, const struct trace_outcome *ended) {
    struct survey *s = user;
    uint64_t last = s->attempt_count - 1;
    if (s->attempt_count && last < SURVEY_ATTEMPTS_MAX &&
        s->attempts[last].begun.number == ended->number)
        s->attempts[last].ended = *ended;
    return true;
}

static bool on_marker(void *user, const struct marker *marker) {
    struct survey *s = user;
    if (s->marker_count < SURVEY_MARKERS_MAX)
        s->markers[s->marker_count] = *marker;
    s->marker_count++;
    return true;
}

void survey_read(struct trace_reader *reader, survey_progress progress, struct survey *s) {
    struct trace_player player = {.user = s,
                                  .step = on_survey_step,
                                  .past = on_past,
                                  .taken = on_taken,
                                  .state = on_survey_state,
                                  .gap = on_gap,
                                  .resume = on_survey_resume,
                                  .fault = on_fault,
                                  .remark = on_remark,
                                  .marker = on_marker,
                                  .begun = on_begun,
                                  .ended = on_ended,
                                  .progress = progress};
    memset(s, 0, sizeof *s);
    s->file_bytes = trace_reader_size(reader);
    s->written_utc_ns = trace_reader_header(reader)->start_utc_ns;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        s->noticing[i].worst.gain = s->noticing[i].worst.gain_least = 1;
    s->end = trace_play(reader, &player, &s->why);
    s->whole_bytes = trace_reader_offset(reader);
    if (s->file_bytes < s->whole_bytes) // it grew: the session goes on
        s->file_bytes = s->whole_bytes;
}

double survey_seconds(const struct survey *s) {
    return (double)(s->last_ns - s->first_ns) / (double)NS_PER_S;
}

bool survey_is_resected(const struct survey *s, int tissue) {
    return s->tissues[tissue].mesh_number || s->tissues[tissue].refused;
}

uint64_t survey_attempts(const struct survey *s) {
    return s->attempt_count < SURVEY_ATTEMPTS_MAX ? s->attempt_count : SURVEY_ATTEMPTS_MAX;
}
