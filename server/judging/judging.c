#include "judging/judging.h"

#include "task/attempt_keep.h"
#include "trace/player.h"
#include "trace/state_session.h"

#include <stdio.h>
#include <string.h>

struct judging {
    const struct trace_header *header;
    const struct scene *scene;
    const struct attempt_taker *taker;
    bool runs;
    struct trace_attempt begun;
    struct task_file file;
    int64_t begun_ns, last_ns; // as of judged_attempt, and of the last step
    struct site *site;
    struct attempt attempt;
    struct kept_attempt kept; // of the state with which the trace begins; else 0
    enum result broken;       // that state
    enum result result;
    struct error refused; // why the first that was
};

static bool is_as_recorded(const struct attempt *a, enum verdict verdict,
                           const struct trace_outcome *o) {
    return a->end == o->end && verdict == o->verdict && a->goals_met == (int64_t)o->goals_met &&
           a->errors == (int64_t)o->errors && a->first_step == o->first_step &&
           a->last_step == o->last_step && a->running_ns == o->time_ns;
}

static void tell(struct judging *j, const struct trace_outcome *ended) {
    struct judged_attempt judged = {.begun = &j->begun,
                                    .begun_ns = j->begun_ns,
                                    .file = &j->file,
                                    .site = j->site,
                                    .attempt = j->attempt,
                                    .ended = ended};
    judged.verdict =
        attempt_verdict_by(&j->attempt, j->begun.pass_time_s, (int)j->begun.pass_errors);
    judged.is_same = !ended || !j->site || is_as_recorded(&j->attempt, judged.verdict, ended);
    j->taker->take(j->taker->user, &judged);
    j->runs = false;
    site_destroy(&j->site);
}

static enum result read_task(struct judging *j, const struct trace_attempt *begun,
                             struct error *err) {
    char name[TASK_NAME_MAX + 8];
    snprintf(name, sizeof name, "%s.ini", begun->task);
    j->file.size = begun->size;
    memcpy(j->file.text, begun->text, begun->size);
    return task_parse(name, begun->text, begun->size, &j->file.task, err);
}

// Of one that had ended before the state, what the trace tells is all there is.
static void take_kept(struct judging *j, const struct trace_attempt *begun) {
    bool runs = begun->number == j->kept.number && kept_attempt_fits(&j->kept, j->site);
    if (begun->number > j->kept.begun)
        return;
    if (!runs) {
        site_destroy(&j->site);
        return;
    }
    j->attempt = j->kept.attempt;
    j->begun_ns = j->header->start_ns + j->kept.begun_ns;
}

// One that is refused is passed over: those behind it may be good.
static bool on_begun(void *user, const struct trace_attempt *begun) {
    struct judging *j = user;
    struct error err;
    if (j->runs) // its end is lost
        tell(j, NULL);
    j->begun = *begun;
    j->begun.text = NULL;
    j->begun_ns = j->last_ns;
    enum result result = read_task(j, begun, &err);
    if (result == RESULT_OK && j->scene)
        result = site_create(&j->file.task, j->scene, &j->header->settings.instruments,
                             &j->header->optic, &j->site, &err);
    if (result != RESULT_OK && j->result == RESULT_OK) {
        j->result = fail_in(&err, RESULT_REFUSED, "attempt %u: ", begun->number);
        j->refused = err;
    }
    j->runs = result == RESULT_OK;
    attempt_init(&j->attempt);
    if (j->site)
        take_kept(j, begun);
    return true;
}

// What is at hand of the steps before this part: what the last one did.
static bool on_elsewhere(void *user, const struct trace_record *record) {
    struct judging *j = user;
    if (j->site)
        attempt_pass(&j->attempt, record->input.kind, record->input.time_ns,
                     &record->output.landed);
    j->last_ns = record->input.time_ns;
    return true;
}

static bool on_state(void *user, const struct trace_state *state) {
    struct judging *j = user;
    struct kept kept = state_section(state, STATE_ATTEMPT);
    kept_attempt_keep(&j->kept, &kept);
    j->last_ns = state->place.time_ns;
    if (!kept.bad && !kept_left(&kept))
        return true;
    j->broken = fail(&j->refused, RESULT_VERSION, "the state with which it begins cannot be read");
    return false;
}

static bool on_step(void *user, const struct trace_record *record) {
    struct judging *j = user;
    if (j->site)
        attempt_take(&j->attempt, j->site, record->input.kind, &record->output);
    j->last_ns = record->input.time_ns;
    return true;
}

static bool on_ended(void *user, const struct trace_outcome *ended) {
    struct judging *j = user;
    if (!j->runs)
        return true;
    attempt_end_as(&j->attempt, ended->end);
    tell(j, ended);
    return true;
}

enum result judge_trace(struct trace_reader *reader, const struct scene *scene,
                        const struct attempt_taker *taker, struct error *err) {
    const struct trace_header *header = trace_reader_header(reader);
    struct judging j = {.header = header,
                        .scene = scene,
                        .taker = taker,
                        .last_ns = header->start_ns,
                        .result = RESULT_OK};
    struct trace_player player = {.user = &j,
                                  .step = on_step,
                                  .past = on_elsewhere,
                                  .taken = on_elsewhere,
                                  .state = on_state,
                                  .begun = on_begun,
                                  .ended = on_ended,
                                  .progress = taker->progress};
    if (scene)
        trace_reader_bind(reader, scene);
    enum result end = trace_play(reader, &player, err);
    if (j.runs)
        tell(&j, NULL);
    site_destroy(&j.site);
    if (j.broken != RESULT_OK)
        return fail(err, j.broken, "%s", j.refused.text);
    if (end != RESULT_CLOSED || j.result == RESULT_OK)
        return end;
    if (err)
        *err = j.refused;
    return j.result;
}
