// Another server goes on with a session from a state and from what its trace told by its tap: the
// tissue, the attempt, the remarks and the figures are those of the session that it lost, and its
// part of the trace replays to the bit. What is damaged is refused.
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "folder.h"
#include "generated.h"
#include "property/busy_hands.h"
#include "runtime/attempt_state.h"
#include "runtime/kept_session.h"
#include "sessions/parts.h"
#include "sessions/restore.h"
#include "test.h"
#include "trace/part.h"
#include "trace/part_chain.h"
#include "trace/player.h"
#include "trace/replay.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define RESOLUTION_MM 2.5
#define STEPS 900
#define KEEP_AT 450
#define ENTRIES_MAX 4096
#define AFTER 200 // steps of the new server

static const struct timespec moment = {.tv_nsec = NS_PER_MS};
static const char task_text[] = "[task]\ntitle = Bend\nbriefing = Bend the knee.\nlimit_s = 3600\n"
                                "[pass]\ntime_s = 60\nsource = none\n"
                                "[goal bent]\ndrawer_mm = 9\nhold_s = 60\n"
                                "[error fast]\ntool = punch\nspeed_mm_s = 5\nnear_mm = 5\n";

static char dir[FOLDER_MAX];
static struct sessions *sessions;
static struct scene *scene;
static struct session_settings settings;
static struct task_file task;
static struct error err;

static int make(void **state) {
    (void)state;
    static const atomic_bool never;
    static const struct error none;
    struct recipe recipe;
    struct knee_case *knee;
    struct pathology loose;
    struct instrument grasper = instrument_grasper();
    assert_ok(recipe_load(CASES "/everything", &recipe, &err));
    recipe.resolution_mm = RESOLUTION_MM;
    assert_ok(generate_knee(&recipe, &knee, &err));
    pathology_init(&loose, PATHOLOGY_LOOSE, "loose");
    assert_ok(pathology_take(&loose, "count", "3", &err));
    assert_ok(pathology_check(&loose, &err));
    assert_ok(pathology_apply(knee, &loose, 0, &err));
    assert_ok(scene_create(&knee, &scene, &err));
    settings = session_settings_default();
    assert_ok(instruments_add(&settings.instruments, &grasper, &err));
    memcpy(task.text, task_text, sizeof task_text);
    task.size = strlen(task_text);
    assert_ok(task_parse("bend.ini", task.text, task.size, &task.task, &err));
    sessions = alloc(1, sizeof *sessions);
    sessions->cancelled = &never;
    sessions->config.case_count = 1;
    sessions->scenes[0] = scene;
    sessions->grades = grades_create(&sessions->config, &scene_case(scene)->hash, &none);
    sessions->sites = site_pool_create();
    folder_make(dir);
    log_set_level(LOG_ERROR);
    return 0;
}

static int drop(void **state) {
    (void)state;
    site_pool_destroy(&sessions->sites);
    grades_destroy(&sessions->grades);
    scene_destroy(&scene);
    free(sessions);
    folder_remove(dir);
    return 0;
}

// ---- a journal ----------------------------------------------------------------------------------

struct entry {
    enum trace_record_type type;
    uint64_t offset;
    size_t size;
    uint8_t *bytes;
};

struct journal {
    struct trace_journal taker;
    struct entry entries[ENTRIES_MAX];
    int count;
};

static void take_tapped(void *user, const struct trace_record *tapped) {
    static struct trace_record kept;
    uint8_t bytes[TRACE_PACKED_MAX];
    struct journal *j = user;
    if (!trace_journal_take(&j->taker, tapped, &kept))
        return;
    CHECK(j->count < ENTRIES_MAX);
    struct entry *e = &j->entries[j->count++];
    *e = (struct entry){kept.type, kept.offset, trace_record_pack(&kept, settings.rules, bytes),
                        NULL};
    e->bytes = alloc(e->size, 1);
    memcpy(e->bytes, bytes, e->size);
}

static void drop_journal(struct journal *j) {
    for (int i = 0; i < j->count; i++)
        free(j->entries[i].bytes);
    free(j);
}

// ---- a session, as a server runs it -------------------------------------------------------------

struct played {
    char path[FOLDER_MAX + 32];
    struct trace_header header;
    struct session_runtime runtime;
    struct session_output out;
    struct job_result *pending;
    struct journal *journal;
    struct trace_tap tap;
    struct busy_hands hands;
    struct metrics at_state;
    uint64_t state_step;
    uint32_t remarks;
};

static struct trace_header header_of(uint64_t seed) {
    struct trace_header h = {.case_hash = scene_case(scene)->hash,
                             .settings = settings,
                             .optic = view_optic_usual(),
                             .loose_count = scene_case(scene)->loose_count,
                             .part = 1,
                             .server = "alpha",
                             .token = 7};
    h.session_id[0] = (uint8_t)seed;
    strcpy(h.station, "bench");
    snprintf(h.case_name, sizeof h.case_name, "%s", scene_case(scene)->name);
    trace_header_set_machine(&h);
    return h;
}

static void append_remark(struct played *p, const char *text) {
    struct remark remark = {.number = ++p->remarks, .time_ns = p->out.time_ns};
    struct marker marker = {.run = 1, .number = p->remarks, .time_ns = p->out.time_ns, .value = 1};
    strcpy(remark.author, "ada");
    snprintf(remark.text, sizeof remark.text, "%s", text);
    strcpy(marker.name, "pedal");
    strcpy(marker.device, "foot");
    assert_true(trace_append_remark(p->runtime.trace, &remark));
    assert_true(trace_append_marker(p->runtime.trace, &marker));
}

static void begin_attempt(struct played *p) {
    struct session_attempt *a = alloc(1, sizeof *a);
    struct trace_attempt begun;
    a->number = ++p->runtime.attempts;
    a->pass_time_s = 60;
    a->begun_ns = p->out.time_ns - p->header.start_ns;
    attempt_init(&a->attempt);
    assert_ok(shared_site_take(sessions->sites, &task, scene, &settings.instruments,
                               &p->header.optic, &a->site, &err));
    attempt_begun(a, &begun);
    assert_true(trace_append_begun(p->runtime.trace, &begun));
    p->runtime.attempt = a;
}

static void end_attempt(struct played *p) {
    struct session_attempt *a = p->runtime.attempt;
    p->runtime.attempt = NULL;
    if (a)
        shared_site_release(&a->site);
    free(a);
}

static void judge(struct played *p, enum input_kind kind) {
    struct session_attempt *a = p->runtime.attempt;
    struct trace_outcome outcome;
    if (!a)
        return;
    attempt_take(&a->attempt, shared_site_site(a->site), kind, &p->out);
    if (a->attempt.end == ATTEMPT_RUNS)
        return;
    attempt_outcome(a, &outcome);
    assert_true(trace_append_ended(p->runtime.trace, &outcome));
    end_attempt(p);
}

static void keep_state(struct played *p, uint64_t position) {
    struct trace_state state = {.output_hash = p->out.hash};
    struct kept session = kept_into(alloc(KEPT_SESSION_MAX, 1), KEPT_SESSION_MAX);
    struct kept operation = kept_growing();
    trace_place_behind(p->runtime.trace, position, &p->out, &state.place);
    kept_session_write(&p->runtime, &p->out.job, &session);
    operation_keep(p->runtime.operation, &operation);
    assert_false(session.bad || operation.bad);
    kept_session_join(&session, &operation, &state);
    enum result result;
    while ((result = trace_state_write(p->path, &state, &err)) == RESULT_MISSING)
        nanosleep(&moment, NULL);
    assert_int_equal(result, RESULT_OK);
    p->state_step = p->out.step;
    p->at_state = p->runtime.metrics.metrics;
    free(state.content);
    free(session.data);
    free(operation.data);
}

static void wait_for_disk(const struct played *p) {
    uint64_t position = trace_position(p->runtime.trace);
    while (!trace_is_on_disk(p->runtime.trace, position))
        nanosleep(&moment, NULL);
}

static void step(struct played *p, const struct session_input *input, bool keeps) {
    struct session_runtime *r = &p->runtime;
    struct session_input own = *input;
    if (own.kind == INPUT_JOB)
        own.result = p->pending;
    session_step(r->session, &own, &p->out);
    assert_true(trace_append(r->trace, &own, &p->out));
    uint64_t position = trace_position(r->trace);
    judge(p, own.kind);
    metrics_step(&r->metrics.metrics, &own, &p->out);
    snapshot_step(&r->snapshots, &p->out);
    r->state = p->out.state;
    if (keeps && session_can_be_kept(r->session, &p->out.job))
        keep_state(p, position);
    if (own.kind == INPUT_JOB)
        job_result_destroy(&p->pending);
    if (p->out.job.id)
        p->pending = operation_run(r->operation, &p->out.job);
}

enum resets { NO_RESETS, WITH_RESETS };

static void next(struct played *p, enum resets resets, struct session_input *input) {
    busy_hands_next(&p->hands, &p->out, p->pending, input);
    if (input->kind == INPUT_RESET && resets == NO_RESETS)
        input->kind = INPUT_UNDO;
    if (p->hands.number % 97 == 0 && resets == WITH_RESETS && input->kind == INPUT_FRAME)
        input->kind = INPUT_RESET;
}

static void play(struct played *p, uint64_t seed, enum resets resets) {
    struct session_runtime *r = &p->runtime;
    struct session_input input = {.kind = INPUT_START};
    *p = (struct played){.header = header_of(seed), .hands = busy_hands_begin(scene, seed)};
    snprintf(p->path, sizeof p->path, "%s/%d.trace", dir, (int)seed);
    unlink(p->path);
    trace_state_remove(p->path);
    p->journal = alloc(1, sizeof *p->journal);
    p->tap = (struct trace_tap){take_tapped, p->journal};
    r->session = session_create(scene, &settings);
    r->operation = operation_create(scene, settings.rules, &settings.instruments);
    metrics_init(&r->metrics.metrics, &settings.instruments, p->header.optic);
    snapshot_begin(&r->snapshots, 0, p->header.start_ns);
    assert_ok(trace_writer_create(p->path, &p->header, NULL, &p->tap, &r->trace, &err));
    for (int i = 0; i < STEPS || p->pending; i++) {
        step(p, &input, i >= KEEP_AT && !p->state_step);
        if (i == 200)
            append_remark(p, "before");
        if (i == 300 || (i > 300 && resets == WITH_RESETS && !r->attempt && i % 50 == 0))
            begin_attempt(p);
        if (i == STEPS - 100)
            append_remark(p, "behind");
        next(p, resets, &input);
    }
    assert_true(p->state_step > 0);
    wait_for_disk(p);
    trace_writer_leave(&r->trace); // as a server that was killed
}

static void end_played(struct played *p) {
    end_attempt(p);
    job_result_destroy(&p->pending);
    session_destroy(&p->runtime.session);
    operation_destroy(&p->runtime.operation);
    drop_journal(p->journal);
}

// ---- the next part ------------------------------------------------------------------------------

struct handed {
    struct trace_header header;
    uint8_t *state;
    size_t size;
    void (*change)(struct trace_record *record); // or NULL
    int swap;                                    // this record with the next one of its kind; -1
};

static struct handed hand_over(const struct played *p, int part, uint64_t token) {
    struct handed h = {.header = p->header, .swap = -1};
    h.header.part = (uint16_t)part;
    h.header.token = token;
    strcpy(h.header.server, "beta");
    assert_ok(trace_state_load(p->path, &h.state, &h.size, &err));
    return h;
}

// What was handed over in all tests.
static struct { int cuts, undone, restored, voided, commands; } tally;

static void count(const struct trace_record *record) {
    const struct job *job = &record->output.job;
    tally.commands += record->type == TRACE_PAST;
    if (record->type != TRACE_TAKEN)
        return;
    tally.cuts += job->kind == JOB_CUT;
    tally.undone += job->kind == JOB_UNDO;
    tally.restored += job->kind == JOB_RESTORE;
    tally.voided += !record->output.landed.job;
}

static void append(struct trace_writer *writer, const struct entry *e, const struct handed *h) {
    static struct trace_record record;
    size_t at = 0;
    assert_ok(trace_record_unpack(e->bytes, e->size, settings.rules, &at, &record, &err));
    assert_int_equal(at, e->size);
    assert_int_equal(trace_record_unpack(e->bytes, e->size, settings.rules, &at, &record, &err),
                     RESULT_CLOSED);
    at = 0;
    assert_ok(trace_record_unpack(e->bytes, e->size, settings.rules, &at, &record, &err));
    count(&record);
    if (h->change)
        h->change(&record);
    assert_ok(trace_append_record(writer, &record, &err));
}

static int entries_behind(const struct played *p, const struct trace_state *state, int *out) {
    int count = 0;
    for (int i = 0; i < p->journal->count; i++) {
        const struct entry *e = &p->journal->entries[i];
        if (e->offset >= state->place.offset || trace_journal_outlasts_state(e->type))
            out[count++] = i;
    }
    return count;
}

static void swap_taken(const struct played *p, int *order, int count) {
    int first = -1;
    for (int i = 0; i < count; i++) {
        if (p->journal->entries[order[i]].type != TRACE_TAKEN)
            continue;
        if (first >= 0) {
            int was = order[first];
            order[first] = order[i];
            order[i] = was;
            return;
        }
        first = i;
    }
    fail_msg("no two jobs were taken over");
}

static void write_part(const struct played *p, const struct handed *h, const char *path) {
    static int order[ENTRIES_MAX];
    struct trace_writer *writer;
    struct trace_state state;
    unlink(path);
    assert_ok(trace_part_create(path, &h->header, h->state, h->size, NULL, NULL, &writer, &err));
    assert_ok(trace_state_parse(h->state, h->size, &state, &err));
    assert_true(state.is_own);
    assert_int_equal(state.place.step, p->state_step);
    int count = entries_behind(p, &state, order);
    if (h->swap >= 0)
        swap_taken(p, order, count);
    for (int i = 0; i < count; i++)
        append(writer, &p->journal->entries[order[i]], h);
    trace_writer_leave(&writer);
}

static char part_path[FOLDER_MAX + 32];

static const char *part_of(const struct played *p, int part) {
    snprintf(part_path, sizeof part_path, "%s/%d-p%d.trace", dir, p->header.session_id[0], part);
    return part_path;
}

// ---- the same session ---------------------------------------------------------------------------

static void assert_same_tissue(const struct operation *a, const struct operation *b) {
    for (int t = 0; t < scene_tissue_count(scene); t++) {
        struct mesh one, other;
        cut_mesh_flatten(operation_mesh(a, t), &one, NULL, NULL);
        cut_mesh_flatten(operation_mesh(b, t), &other, NULL, NULL);
        assert_int_equal(one.vertex_count, other.vertex_count);
        assert_int_equal(one.triangle_count, other.triangle_count);
        for (uint32_t v = 0; v < one.vertex_count; v++) {
            vec3 p = mesh_vertex(&one, v), q = mesh_vertex(&other, v);
            assert_memory_equal(&p, &q, sizeof p);
        }
        assert_memory_equal(one.triangles, other.triangles,
                            3 * one.triangle_count * sizeof *one.triangles);
        assert_memory_equal(operation_figures(a, t), operation_figures(b, t),
                            sizeof(struct tissue_figures));
        mesh_fini(&one);
        mesh_fini(&other);
    }
}

struct figures {
    double of[4096];
    int count;
};

static void take_figure(void *user, const struct metric_value *v) {
    struct figures *f = user;
    if (v->tissue < 0 && f->count < 4096)
        f->of[f->count++] = v->value;
}

// What was measured up to the state; what has landed since counts, too.
static void assert_same_metrics(const struct played *p, const struct metrics *found) {
    static struct figures before, after;
    struct metrics kept = p->at_state;
    before.count = after.count = 0;
    metrics_interrupt(&kept);
    metrics_each(&kept, NULL, take_figure, &before);
    metrics_each(found, NULL, take_figure, &after);
    assert_int_equal(before.count, after.count);
    assert_memory_equal(before.of, after.of, (size_t)before.count * sizeof *before.of);
}

static void assert_same_attempt(const struct played *p, const struct restored *r) {
    const struct session_attempt *a = p->runtime.attempt, *b = r->session->runtime.attempt;
    assert_int_equal(r->attempts, p->runtime.attempts);
    assert_int_equal(r->attempt_lost, 0);
    assert_true(!a == !b);
    if (!a)
        return;
    assert_int_equal(a->number, b->number);
    assert_int_equal(a->attempt.end, b->attempt.end);
    assert_int_equal(a->attempt.cut, b->attempt.cut);
    assert_memory_equal(a->attempt.resections, b->attempt.resections, sizeof a->attempt.resections);
}

static void assert_same_session(const struct played *p, const struct restored *r) {
    const struct session_runtime *live = &p->runtime;
    assert_same_tissue(live->operation, r->session->runtime.operation);
    assert_int_equal(r->state, p->out.state);
    assert_int_equal(r->kept_step, p->state_step);
    assert_int_equal(r->remarks.count, p->remarks);
    assert_memory_equal(r->metrics.tissues, live->metrics.metrics.tissues,
                        sizeof r->metrics.tissues);
    assert_memory_equal(r->metrics.undone, live->metrics.metrics.undone, sizeof r->metrics.undone);
    assert_same_attempt(p, r);
    assert_null(r->session->runtime.pending);
    assert_int_equal(r->asked.id, 0);
}

// ---- going on -----------------------------------------------------------------------------------

// The new server's steps, in its part. What the session was, it leaves to `next`.
static void go_on(struct restored *restored, const char *path, struct played *p) {
    struct session_runtime *r = &restored->session->runtime;
    struct played next_one = {.header = restored->header, .hands = p->hands};
    struct session_input input = {.kind = INPUT_EMPTY, .time_ns = restored->place.time_ns};
    next_one.runtime = *r;
    next_one.runtime.metrics.metrics = restored->metrics;
    next_one.runtime.attempt = NULL; // it is the restored one's
    next_one.out.state = restored->state;
    next_one.hands.time_ns = restored->place.time_ns;
    assert_ok(
        trace_writer_resume(path, &restored->place, 0, NULL, NULL, &next_one.runtime.trace, &err));
    for (int i = 0; i < AFTER || next_one.pending; i++) {
        step(&next_one, &input, false);
        next(&next_one, NO_RESETS, &input);
    }
    uint64_t hash = next_one.out.hash;
    trace_writer_leave(&next_one.runtime.trace);
    struct restored again;
    assert_int_equal(restore_run(sessions, path, NULL, &again, &err), RESULT_MISSING);
    assert_true(session_hash(again.session->runtime.session) == hash);
    assert_same_tissue(r->operation, again.session->runtime.operation);
    restore_fini(&again);
}

static void assert_replays(const char *path) {
    struct trace_reader *reader;
    struct replay_report report;
    assert_ok(trace_reader_create(path, &reader, &err));
    assert_ok(trace_replay(reader, scene, NULL, NULL, &report, &err));
    trace_reader_destroy(&reader);
    if (report.different)
        fail_msg("step %d: %s was %s, now %s", (int)report.first.step, report.first.field,
                 report.first.recorded, report.first.replayed);
    assert_int_equal(report.verdict, REPLAY_IDENTICAL);
    assert_true(report.steps >= AFTER && report.taken > 0);
    assert_int_equal(report.taken_otherwise, 0);
    assert_int_equal(report.left_out, 0);
}

static void try_seed(uint64_t seed, enum resets resets) {
    struct played p;
    struct restored restored;
    play(&p, seed, resets);
    struct handed h = hand_over(&p, 2, 9);
    const char *path = part_of(&p, 2);
    write_part(&p, &h, path);
    enum result result = restore_run(sessions, path, NULL, &restored, &err);
    if (result != RESULT_MISSING)
        fail_msg("seed %d: %s", (int)seed, err.text);
    assert_same_session(&p, &restored);
    if (resets == NO_RESETS)
        assert_same_metrics(&p, &restored.metrics);
    go_on(&restored, path, &p);
    restore_fini(&restored);
    assert_replays(path);
    const char *both[] = {path, p.path};
    assert_ok(trace_parts_check(both, 2, &err));
    free(h.state);
    end_played(&p);
}

static void another_server_goes_on_with_the_same_session(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++)
        try_seed(seed, NO_RESETS);
}

static void resets_and_voided_jobs_are_taken_over(void **state) {
    (void)state;
    for (uint64_t seed = 11; seed <= 13; seed++)
        try_seed(seed, WITH_RESETS);
    print_message("%d cuts, %d undone, %d restored, %d of these void; %d commands\n", tally.cuts,
                  tally.undone, tally.restored, tally.voided, tally.commands);
    assert_true(tally.cuts > 50 && tally.undone > 0 && tally.restored > 0 && tally.voided > 0 &&
                tally.commands > 0);
}

// ---- what is refused ----------------------------------------------------------------------------

static struct played lost; // of all tests below, which change nothing of it

static void assert_refused(enum result result, enum result expected, const char *why) {
    if (result != expected || !strstr(err.text, why))
        fail_msg("result %d, not %d: %s", (int)result, (int)expected, err.text);
}

static enum result restore(const char *path) {
    struct restored restored;
    enum result result = restore_run(sessions, path, NULL, &restored, &err);
    restore_fini(&restored);
    return result;
}

static enum result check(const char *a, const char *b) {
    const char *both[] = {a, b};
    return trace_parts_check(both, 2, &err);
}

static void a_state_of_another_session_is_no_part(void **state) {
    (void)state;
    struct played other;
    play(&other, 22, NO_RESETS);
    struct handed h = hand_over(&other, 2, 9);
    memcpy(h.header.session_id, lost.header.session_id, sizeof h.header.session_id);
    write_part(&other, &h, part_of(&lost, 2));
    assert_refused(check(lost.path, part_path), RESULT_REFUSED, "another step");
    assert_refused(check(other.path, part_path), RESULT_REFUSED, "of another session");
    free(h.state);
    end_played(&other);
}

static void parts_are_missed_and_tokens_rise(void **state) {
    (void)state;
    struct handed h = hand_over(&lost, 3, 9);
    write_part(&lost, &h, part_of(&lost, 3));
    assert_refused(check(part_path, lost.path), RESULT_REFUSED, "part 2 of the session is missing");
    h.header.part = 2;
    h.header.token = 7;
    write_part(&lost, &h, part_of(&lost, 2));
    assert_refused(check(part_path, lost.path), RESULT_REFUSED, "part 2 has the token 7");
    assert_refused(check(part_path, part_path), RESULT_REFUSED, "part 1 of the session is missing");
    assert_refused(check(lost.path, lost.path), RESULT_REFUSED, "both are part 1");
    free(h.state);
}

// A third server may begin with the state of the first, where the second had kept none.
static void a_state_may_begin_two_parts(void **state) {
    (void)state;
    char second[FOLDER_MAX + 32];
    struct handed h = hand_over(&lost, 2, 9);
    write_part(&lost, &h, part_of(&lost, 2));
    strcpy(second, part_path);
    h.header.part = 3;
    h.header.token = 10;
    write_part(&lost, &h, part_of(&lost, 3));
    const char *all[] = {part_path, lost.path, second};
    assert_ok(trace_parts_check(all, 3, &err));
    free(h.state);
}

static void what_is_out_of_order_is_refused(void **state) {
    (void)state;
    struct handed h = hand_over(&lost, 2, 9);
    h.swap = 0;
    write_part(&lost, &h, part_of(&lost, 2));
    enum result result = restore(part_path);
    assert_true(result == RESULT_FORMAT || result == RESULT_REFUSED);
    assert_non_null(strstr(err.text, "job"));
    free(h.state);
}

static void change_hash(struct trace_record *record) {
    if (record->type == TRACE_TAKEN && record->output.landed.job)
        record->output.landed.hash ^= 1;
}

static void a_job_that_lands_otherwise_is_told(void **state) {
    (void)state;
    struct handed h = hand_over(&lost, 2, 9);
    h.change = change_hash;
    write_part(&lost, &h, part_of(&lost, 2));
    assert_refused(restore(part_path), RESULT_REFUSED, "does not land here as it did there");
    assert_refused(check(lost.path, part_path), RESULT_REFUSED, "landed otherwise");
    free(h.state);
}

static void change_id(struct trace_record *record) {
    if (record->type == TRACE_TAKEN) {
        record->output.job.id += 1;
        record->output.landed.job += record->output.landed.job != 0;
        record->input.job += 1;
    }
}

// The touches before them are of other jobs, then.
static void jobs_of_other_numbers_are_refused(void **state) {
    (void)state;
    struct handed h = hand_over(&lost, 2, 9);
    h.change = change_id;
    write_part(&lost, &h, part_of(&lost, 2));
    enum result result = restore(part_path);
    assert_true(result == RESULT_FORMAT || result == RESULT_REFUSED);
    assert_non_null(strstr(err.text, "does not land"));
    free(h.state);
}

static void copy_file(const char *from, const char *to, size_t size) {
    uint8_t *bytes = alloc(size, 1);
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    assert_int_equal(fread(bytes, 1, size, in), size);
    assert_int_equal(fwrite(bytes, 1, size, out), size);
    fclose(in);
    fclose(out);
    free(bytes);
}

static void what_is_cut_off_is_refused(void **state) {
    (void)state;
    struct trace_state kept;
    char copy[FOLDER_MAX + 32];
    struct handed h = hand_over(&lost, 2, 9);
    write_part(&lost, &h, part_of(&lost, 2));
    assert_ok(trace_state_parse(h.state, h.size, &kept, &err));
    assert_int_equal(truncate(part_path, (off_t)(h.size / 2)), 0);
    assert_refused(restore(part_path), RESULT_REFUSED, "ends within the state");
    write_part(&lost, &h, part_path);
    snprintf(copy, sizeof copy, "%s/copy", dir);
    copy_file(lost.path, copy, kept.place.offset - 1);
    assert_refused(check(copy, part_path), RESULT_REFUSED, "which part 1 does not have");
    free(h.state);
}

static void a_damaged_state_makes_no_part(void **state) {
    (void)state;
    struct random r = {3};
    struct trace_writer *writer;
    struct handed h = hand_over(&lost, 2, 9);
    part_of(&lost, 4);
    for (int i = 0; i < 50; i++) {
        uint8_t *byte = &h.state[random_bits(&r) % h.size];
        uint8_t was = *byte;
        *byte ^= (uint8_t)(1 << random_bits(&r) % 8);
        assert_refused(
            trace_part_create(part_path, &h.header, h.state, h.size, NULL, NULL, &writer, &err),
            RESULT_CORRUPT, "it is");
        *byte = was;
    }
    h.header.part = 1;
    assert_refused(
        trace_part_create(part_path, &h.header, h.state, h.size, NULL, NULL, &writer, &err),
        RESULT_REFUSED, "part 1 of a session begins with no state");
    assert_int_not_equal(access(part_path, F_OK), 0);
    free(h.state);
}

static void nothing_is_taken_over_in_a_first_part(void **state) {
    (void)state;
    struct trace_writer *writer;
    struct trace_reader *reader;
    struct trace_record record;
    static struct trace_record taken = {.type = TRACE_TAKEN, .job_done = true};
    taken.input.kind = INPUT_JOB;
    taken.output.job = (struct job){.id = 1, .kind = JOB_UNDO};
    part_of(&lost, 5);
    assert_ok(trace_writer_create(part_path, &lost.header, NULL, NULL, &writer, &err));
    assert_ok(trace_append_record(writer, &taken, &err));
    trace_writer_destroy(&writer);
    assert_ok(trace_reader_create(part_path, &reader, &err));
    assert_refused(trace_read(reader, &record, &err), RESULT_FORMAT,
                   "job 1 is taken over where none can be");
    trace_reader_destroy(&reader);
}

// Bytes of a network: whatever they are, records come out in their ranges or none.
static void damaged_bytes_of_a_journal_are_refused_or_in_range(void **state) {
    (void)state;
    struct random r = {5};
    static struct trace_record record;
    uint8_t bytes[TRACE_PACKED_MAX];
    int refused = 0, tries = 0;
    for (int i = 0; i < 20 * lost.journal->count; i++) {
        const struct entry *e = &lost.journal->entries[i % lost.journal->count];
        size_t at = 0, size = e->size;
        memcpy(bytes, e->bytes, size);
        bytes[random_bits(&r) % size] ^= (uint8_t)(1 << random_bits(&r) % 8);
        size -= i % 5 == 0 ? random_bits(&r) % size : 0;
        enum result result = trace_record_unpack(bytes, size, settings.rules, &at, &record, &err);
        assert_true(result == RESULT_OK || result == RESULT_FORMAT || result == RESULT_LIMIT);
        assert_true(at <= size && (result == RESULT_OK) == (at > 0));
        refused += result != RESULT_OK;
        tries++;
    }
    print_message("%d of %d refused\n", refused, tries);
    assert_true(refused > tries / 10);
}

static int make_all(void **state) {
    make(state);
    play(&lost, 21, NO_RESETS);
    return 0;
}

static int drop_all(void **state) {
    end_played(&lost);
    return drop(state);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(another_server_goes_on_with_the_same_session),
        cmocka_unit_test(resets_and_voided_jobs_are_taken_over),
        cmocka_unit_test(a_state_of_another_session_is_no_part),
        cmocka_unit_test(parts_are_missed_and_tokens_rise),
        cmocka_unit_test(a_state_may_begin_two_parts),
        cmocka_unit_test(what_is_out_of_order_is_refused),
        cmocka_unit_test(a_job_that_lands_otherwise_is_told),
        cmocka_unit_test(jobs_of_other_numbers_are_refused),
        cmocka_unit_test(what_is_cut_off_is_refused),
        cmocka_unit_test(a_damaged_state_makes_no_part),
        cmocka_unit_test(nothing_is_taken_over_in_a_first_part),
        cmocka_unit_test(damaged_bytes_of_a_journal_are_refused_or_in_range),
    };
    return cmocka_run_group_tests(tests, make_all, drop_all);
}
