#include "trace/replay.h"

#include "base/check.h"
#include "trace/player.h"

#include <string.h>

struct replay {
    struct rerun *rerun;
    struct step_field fields[STEP_FIELDS_MAX];
    int field_count;
    struct replay_report *report;
    const struct replay_span *span;
    enum result result;         // of taking over a state
    uint64_t steps;             // run
    bool gap;                   // steps after it are not run
    int64_t start_ns, first_ns; // as the header says; of the first step
};

const char *replay_verdict_name(enum replay_verdict verdict) {
    static const char *const names[REPLAY_VERDICT_COUNT] = {"identical", "equivalent", "different"};
    return (unsigned)verdict < REPLAY_VERDICT_COUNT ? names[verdict] : "unknown";
}

static void compare_machines(const struct trace_header *header, struct replay_report *report) {
    struct trace_header here;
    trace_header_set_machine(&here);
    report->same_build = !strcmp(here.build, header->build);
    report->same_libc = !strcmp(here.libc, header->libc);
    report->same_cpu = !strcmp(here.cpu, header->cpu);
}

// Infinite where only one of the two is there, or one is no number.
static double tip_distance(const struct instrument_output *a, const struct instrument_output *b) {
    if (!a->present && !b->present)
        return 0;
    double mm = vec3_distance(a->T_mockup_warped.translation, b->T_mockup_warped.translation);
    return a->present == b->present && !isnan(mm) ? mm : INFINITY;
}

static void note_difference(const struct replay *replay, const struct step_field *field,
                            const struct session_output *recorded,
                            const struct session_output *replayed) {
    struct replay_difference *first = &replay->report->first;
    first->step = recorded->step;
    memcpy(first->field, field->name, sizeof first->field);
    step_field_text(field, recorded, first->recorded);
    step_field_text(field, replayed, first->replayed);
}

static void compare_outputs(const struct replay *replay, const struct session_output *recorded,
                            const struct session_output *replayed) {
    struct replay_report *report = replay->report;
    report->steps++;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        report->largest_mm = fmax(
            report->largest_mm, tip_distance(&recorded->instruments[i], &replayed->instruments[i]));
    if (recorded->state != replayed->state || recorded->events != replayed->events)
        report->same_events = false;
    for (int i = 0; i < replay->field_count; i++) {
        if (step_field_equal(&replay->fields[i], recorded, replayed))
            continue;
        if (report->different++ == 0)
            note_difference(replay, &replay->fields[i], recorded, replayed);
        return;
    }
}

static void run_step(struct replay *replay, const struct trace_record *record) {
    struct replay_report *report = replay->report;
    const struct replay_span *span = replay->span;
    struct session_output output;
    rerun_step(replay->rerun, record, &output);
    if (replay->steps++ == 0)
        replay->first_ns = record->input.time_ns;
    report->session_ns = record->input.time_ns - replay->first_ns;
    int64_t at_ns = record->input.time_ns - replay->start_ns;
    bool asked_for = !span || (at_ns >= span->from_ns && at_ns <= span->to_ns);
    if (record->type == TRACE_STEP && asked_for)
        compare_outputs(replay, &record->output, &output);
}

// False behind the span: the rest of the trace need not be read.
static bool on_replay_step(void *user, const struct trace_record *record) {
    struct replay *replay = user;
    if (replay->span && record->input.time_ns - replay->start_ns > replay->span->to_ns)
        return false;
    if (replay->gap)
        replay->report->left_out++;
    else
        run_step(replay, record);
    return true;
}

static bool on_past(void *user, const struct trace_record *record) {
    struct replay *replay = user;
    if (!replay->gap)
        run_step(replay, record);
    return true;
}

static bool on_replay_state(void *user, const struct trace_state *state) {
    struct replay *replay = user;
    struct replay_report *report = replay->report;
    replay->result = rerun_take_over(replay->rerun, state, &report->why);
    return replay->result == RESULT_OK;
}

// It is no step of this trace, but those that follow depend on it.
static bool on_taken(void *user, const struct trace_record *record) {
    struct replay *replay = user;
    struct replay_report *report = replay->report;
    struct session_output output;
    rerun_step(replay->rerun, record, &output);
    report->taken++;
    if (rerun_lands_as_recorded(record, &output))
        return true;
    if (report->taken_otherwise++ == 0)
        report->first_otherwise = record->output.job.id;
    return true;
}

static bool on_replay_gap(void *user, uint64_t missing) {
    struct replay *replay = user;
    replay->gap = true;
    replay->report->left_out += missing;
    return true;
}

static void run_steps(struct replay *replay, struct trace_reader *reader,
                      void (*progress)(uint64_t done, uint64_t all)) {
    struct trace_player player = {.user = replay,
                                  .step = on_replay_step,
                                  .past = on_past,
                                  .taken = on_taken,
                                  .state = on_replay_state,
                                  .gap = on_replay_gap,
                                  .progress = progress};
    struct replay_report *report = replay->report;
    report->end = trace_play(reader, &player, &report->why);
    if (report->end == RESULT_OK)
        report->end = replay->result == RESULT_OK ? RESULT_CLOSED : replay->result;
}

static enum replay_verdict judge(const struct replay_report *report) {
    bool same_machine = report->same_build && report->same_libc && report->same_cpu;
    bool as_taken = !report->taken_otherwise;
    if (report->different == 0 && as_taken && (!report->touches.different || !same_machine))
        return REPLAY_IDENTICAL;
    bool close = as_taken && report->same_events && report->largest_mm <= REPLAY_TOLERANCE_MM;
    return !same_machine && close ? REPLAY_EQUIVALENT : REPLAY_DIFFERENT;
}

// What a trace of this version has.
static int fields_of(int version, struct step_field fields[STEP_FIELDS_MAX]) {
    int count = step_fields(fields), kept = 0;
    for (int i = 0; i < count; i++)
        if (fields[i].since <= version)
            fields[kept++] = fields[i];
    return kept;
}

enum result trace_replay(struct trace_reader *reader, const struct scene *scene,
                         const struct replay_span *span,
                         void (*progress)(uint64_t done, uint64_t all),
                         struct replay_report *out_report, struct error *err) {
    const struct trace_header *header = trace_reader_header(reader);
    const struct knee_case *knee = scene_case(scene);
    if (knee->hash != header->case_hash)
        return fail(err, RESULT_REFUSED,
                    "case %s has the hash %016llx, the session was recorded with case %s of hash "
                    "%016llx",
                    knee->name, (unsigned long long)knee->hash, header->case_name,
                    (unsigned long long)header->case_hash);
    memset(out_report, 0, sizeof *out_report);
    out_report->same_events = true;
    compare_machines(header, out_report);
    out_report->rules = header->settings.rules;
    out_report->digits = settings_digits(&header->settings);
    trace_reader_bind(reader, scene);
    struct replay replay = {.report = out_report, .span = span, .start_ns = header->start_ns};
    replay.rerun = rerun_create(scene, &header->settings);
    replay.field_count = fields_of(header->version, replay.fields);
    run_steps(&replay, reader, progress);
    out_report->touches = rerun_touches(replay.rerun);
    rerun_destroy(&replay.rerun);
    out_report->verdict = judge(out_report);
    return RESULT_OK;
}
