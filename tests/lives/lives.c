#include "lives/lives.h"

#include "base/check.h"
#include "base/clock.h"
#include "random.h"
#include "trace/player.h"
#include "trace/rerun.h"
#include "trace/state.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define TORN_BYTES 40 // less than the shortest record: a kill takes the last one
#define AHEAD_BYTES ((uint64_t)1 << 20)
#define JOB_NS (100 * NS_PER_MS)
#define KEPT_EVERY 150 // steps

struct living {
    const struct task_file *file;
    const struct scene *scene;
    const char *path;
    struct trace_writer *trace;
    struct session *session;
    struct operation *operation;
    struct job_result *landing;
    int64_t lands_ns; // the earliest
    uint64_t awaited; // of the trace: so much was appended when its disk was last waited for
    struct task task; // of the site
    struct site *site;
    struct attempt attempt, before; // after the last step, and after the one before
    struct lives *lives;
    int kills; // that are to come, about
};

// ---- steps --------------------------------------------------------------------------------------

// Steps in virtual time come faster than any disk takes them.
static void wait_for_disk(struct living *l) {
    if (trace_position(l->trace) - l->awaited < AHEAD_BYTES)
        return;
    while (!trace_is_on_disk(l->trace, l->awaited))
        nanosleep(&(struct timespec){.tv_nsec = NS_PER_MS}, NULL);
    l->awaited = trace_position(l->trace);
}

// As a server does: before the job of the step is run. end: the trace's position behind the step.
static void keep(struct living *l, struct session_output *output, uint64_t end) {
    struct trace_state state = {.output_hash = output->hash};
    struct kept k = kept_growing();
    operation_keep(l->operation, &k);
    session_keep(l->session, &output->job, NULL, &k);
    CHECK(!k.bad);
    state.content = k.data;
    state.size = k.used;
    trace_place_behind(l->trace, end, output, &state.place);
    while (trace_state_write(l->path, &state, NULL) == RESULT_MISSING)
        nanosleep(&(struct timespec){.tv_nsec = NS_PER_MS}, NULL);
    free(k.data);
}

static void step(struct living *l, const struct session_input *input) {
    struct session_output output;
    session_step(l->session, input, &output);
    CHECK(trace_append(l->trace, input, &output));
    uint64_t end = trace_position(l->trace);
    if (l->kills && output.step % KEPT_EVERY == 0 && session_can_be_kept(l->session, &output.job))
        keep(l, &output, end);
    wait_for_disk(l);
    l->before = l->attempt;
    attempt_take(&l->attempt, l->site, input->kind, &output);
    l->lives->steps++;
    if (output.job.id) {
        job_result_destroy(&l->landing);
        l->landing = operation_run(l->operation, &output.job);
        l->lands_ns = output.time_ns + JOB_NS;
    }
}

static void land(struct living *l, int64_t time_ns) {
    struct job_result *result = l->landing;
    if (!result || time_ns < l->lands_ns)
        return;
    l->landing = NULL;
    step(l, &(struct session_input){
                .kind = INPUT_JOB, .time_ns = time_ns, .job = result->job, .result = result});
    job_result_destroy(&result);
}

static void add(struct frame *frame, struct sample sample) {
    sample.time_ns = frame->time_ns;
    frame->samples[frame->count++] = sample;
}

static void play_row(struct living *l, const struct motion *motion, size_t row, int64_t time_ns) {
    const struct motion_row *r = &motion->rows[row];
    struct session_input input = {
        .kind = INPUT_FRAME, .time_ns = time_ns, .frame = {.number = row + 1, .time_ns = time_ns}};
    add(&input.frame,
        (struct sample){.channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT, .joint = r->joint});
    for (int i = 0; i < motion->tool_count; i++) {
        enum channel channel = motion->tools[i].channel;
        bool runs = channel == CHANNEL_SHAVER && r->tools[i].opening > 0;
        add(&input.frame, (struct sample){.channel = channel,
                                          .kind = SAMPLE_POSE,
                                          .T_mockup_body = r->tools[i].T_mockup_tip});
        add(&input.frame, (struct sample){.channel = channel,
                                          .kind = SAMPLE_HANDLE,
                                          .handle = {r->tools[i].opening, runs ? 1 : 0}});
    }
    step(l, &input);
}

// ---- a kill -------------------------------------------------------------------------------------

struct resuming {
    struct living *living;
    const struct trace_header *header;
    struct trace_reader *reader;
    struct rerun *rerun;
    struct trace_place place;
    uint64_t kept; // what is before it in the file needs not be run
};

static void make_site(struct living *l, const struct trace_header *header,
                      const struct trace_attempt *begun) {
    char name[TASK_NAME_MAX + 8];
    snprintf(name, sizeof name, "%s.ini", begun->task);
    site_destroy(&l->site);
    enum result result = task_parse(name, begun->text, begun->size, &l->task, NULL);
    CHECK(result == RESULT_OK);
    result = site_create(&l->task, l->scene, &header->settings.instruments, &header->optic,
                         &l->site, NULL);
    CHECK(result == RESULT_OK);
}

static bool on_record(void *user, const struct trace_record *record) {
    struct resuming *r = user;
    struct living *l = r->living;
    struct session_output output;
    if (record->type == TRACE_BEGUN) {
        make_site(l, r->header, &record->begun);
        attempt_init(&l->attempt);
    }
    if (record->type == TRACE_STEP && record->offset < r->kept) {
        if (l->site)
            attempt_take(&l->attempt, l->site, record->input.kind, &record->output);
    } else if (record->type == TRACE_STEP) {
        rerun_step(r->rerun, record, &output);
        CHECK(output.hash == record->output.hash);
        if (l->site)
            attempt_take(&l->attempt, l->site, record->input.kind, &output);
    }
    r->place = trace_reader_place(r->reader);
    return true;
}

// False: there is no state, or it is of a step that was torn.
static bool begin_kept(struct resuming *r) {
    struct trace_state state;
    struct job asked = {0};
    struct living *l = r->living;
    if (trace_state_read(l->path, &state, NULL) != RESULT_OK)
        return false;
    bool fits = trace_reader_skim(r->reader, &state.place, state.output_hash, NULL) == RESULT_OK;
    if (fits) {
        const struct session_settings *settings = &r->header->settings;
        struct session *session = session_create(l->scene, settings);
        struct operation *operation =
            operation_create(l->scene, settings->rules, &settings->instruments);
        struct kept k = kept_from(state.content, state.size);
        operation_keep(operation, &k);
        session_keep(session, &asked, operation, &k);
        CHECK(!k.bad && !kept_left(&k));
        r->rerun = rerun_go_on(session, operation, &asked);
        r->kept = state.place.offset;
        l->lives->kept++;
    }
    free(state.content);
    return fits;
}

static void resume(struct living *l) {
    struct resuming r = {.living = l};
    struct trace_player player = {.user = &r, .record = on_record};
    enum result result = trace_reader_create(l->path, &r.reader, NULL);
    CHECK(result == RESULT_OK);
    r.header = trace_reader_header(r.reader);
    if (!begin_kept(&r))
        r.rerun = rerun_create(l->scene, &r.header->settings);
    trace_reader_bind(r.reader, l->scene);
    result = trace_play(r.reader, &player, NULL);
    CHECK(result == RESULT_MISSING);
    rerun_release(&r.rerun, &l->session, &l->operation, &l->landing, NULL);
    result = trace_writer_resume(l->path, &r.place, 0, NULL, NULL, &l->trace, NULL);
    CHECK(result == RESULT_OK);
    l->awaited = trace_position(l->trace);
    l->lands_ns = 0; // when it was asked for is lost
    trace_reader_destroy(&r.reader);
}

static void tear(const char *path, uint64_t bytes) {
    FILE *file = fopen(path, "re");
    CHECK(file && fseek(file, 0, SEEK_END) == 0);
    long size = ftell(file);
    fclose(file);
    CHECK(truncate(path, size - (long)bytes) == 0);
}

// All is lost but the trace, of which the last record is torn.
static void kill_and_resume(struct living *l, struct random *random) {
    struct attempt expected = l->before;
    trace_writer_leave(&l->trace);
    session_destroy(&l->session);
    operation_destroy(&l->operation);
    job_result_destroy(&l->landing);
    site_destroy(&l->site);
    memset(&l->attempt, 0xa5, sizeof l->attempt);
    tear(l->path, 1 + random_bits(random) % TORN_BYTES);
    resume(l);
    l->lives->kills++;
    l->lives->differences += !attempt_is_same(&l->attempt, &expected);
}

// ---- begin and end ------------------------------------------------------------------------------

static struct trace_header header_of(const struct scene *scene, const struct task *task) {
    struct trace_header header = {.start_ns = 1,
                                  .case_hash = scene_case(scene)->hash,
                                  .settings = session_settings_default(),
                                  .optic = task_optic(task),
                                  .loose_count = scene_case(scene)->loose_count};
    header.settings.instruments = *instruments_of_hands();
    header.session_id[0] = 1;
    snprintf(header.case_name, sizeof header.case_name, "%s", scene_case(scene)->name);
    trace_header_set_machine(&header);
    return header;
}

static void begin(struct living *l) {
    struct trace_attempt begun = {.number = 1,
                                  .pass_time_s = l->file->task.pass_time_s,
                                  .pass_errors = (uint32_t)l->file->task.pass_errors,
                                  .size = (uint32_t)l->file->size,
                                  .text = l->file->text};
    memcpy(begun.task, l->file->task.name, sizeof begun.task);
    CHECK(trace_append_begun(l->trace, &begun));
    attempt_init(&l->attempt);
}

static void end(struct living *l) {
    const struct attempt *a = &l->attempt;
    attempt_leave(&l->attempt, true);
    l->lives->verdict = attempt_verdict(a, &l->file->task);
    l->lives->attempt = *a;
    struct trace_outcome outcome = {.number = 1,
                                    .end = a->end,
                                    .verdict = l->lives->verdict,
                                    .goals_met = (uint32_t)a->goals_met,
                                    .errors = (uint32_t)a->errors,
                                    .first_step = a->first_step,
                                    .last_step = a->last_step,
                                    .time_ns = a->running_ns};
    CHECK(trace_append_ended(l->trace, &outcome));
    trace_writer_destroy(&l->trace);
    session_destroy(&l->session);
    operation_destroy(&l->operation);
    job_result_destroy(&l->landing);
    site_destroy(&l->site);
}

static void compare(void *user, const struct judged_attempt *judged) {
    struct lives *lives = user;
    lives->traced_verdict = judged->verdict;
    lives->differences += !judged->is_same || !attempt_is_same(&judged->attempt, &lives->attempt);
}

static void judge(const struct living *l) {
    struct trace_reader *reader;
    struct attempt_taker taker = {.user = l->lives, .take = compare};
    enum result result = trace_reader_create(l->path, &reader, NULL);
    CHECK(result == RESULT_OK);
    result = judge_trace(reader, l->scene, &taker, NULL);
    l->lives->differences += result != RESULT_CLOSED || l->lives->traced_verdict == VERDICT_OPEN;
    trace_reader_destroy(&reader);
}

enum result lives_run(const struct task_file *file, const struct scene *scene,
                      const struct motion *motion, double rate_hz, int kills, uint64_t seed,
                      const char *trace, struct lives *out, struct error *err) {
    memset(out, 0, sizeof *out);
    struct living l = {.file = file,
                       .scene = scene,
                       .path = trace,
                       .task = file->task,
                       .lives = out,
                       .kills = kills};
    struct trace_header header = header_of(scene, &file->task);
    enum result result =
        site_create(&l.task, scene, &header.settings.instruments, &header.optic, &l.site, err);
    if (result == RESULT_OK)
        result = trace_writer_create(trace, &header, NULL, NULL, &l.trace, err);
    if (result != RESULT_OK) {
        site_destroy(&l.site);
        return result;
    }
    l.session = session_create(scene, &header.settings);
    l.operation = operation_create(scene, header.settings.rules, &header.settings.instruments);
    struct random random = {seed + 1};
    double row_ns = NS_PER_S / rate_hz;
    begin(&l);
    step(&l, &(struct session_input){.kind = INPUT_START, .time_ns = 1});
    for (size_t row = 0; row < motion->row_count && l.attempt.end == ATTEMPT_RUNS; row++) {
        int64_t time_ns = 2 + (int64_t)((double)(row + 1) * row_ns);
        land(&l, time_ns);
        play_row(&l, motion, row, time_ns);
        if (kills && row > 1 && l.attempt.end == ATTEMPT_RUNS &&
            random_bits(&random) % (motion->row_count / (uint64_t)kills + 1) == 0)
            kill_and_resume(&l, &random);
    }
    end(&l);
    judge(&l);
    return RESULT_OK;
}
