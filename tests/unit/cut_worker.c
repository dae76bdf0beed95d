// A session that cuts faster than its jobs are done: what stations are told is what was cut.
#include "base/clock.h"
#include "runtime/tissue_delta.h"
#include "sessions/parts.h"
#include "test.h"
#include "trace/replay.h"
#include "unit/case_knee.h"
#include "unit/hall.h"

#include <stdio.h>
#include <string.h>

// ---- what was cut, by the session's own record --------------------------------------------------

static struct scene *load_scene(void) {
    struct case_limits limits = case_limits_default();
    struct knee_case *knee;
    struct scene *scene;
    char folder[256];
    snprintf(folder, sizeof folder, "%s/case", hall_dir);
    assert_int_equal(case_load(folder, &limits, &knee, NULL), RESULT_OK);
    assert_int_equal(scene_create(&knee, &scene, NULL), RESULT_OK);
    return scene;
}

static uint64_t hash_of(const struct cut_mesh *mesh) {
    struct tissue tissue = {0};
    struct mesh_delta whole;
    tissue_delta_whole(mesh, &whole);
    whole.number = 1;
    assert_int_equal(tissue_change(&tissue, &whole, NULL), RESULT_OK);
    uint64_t hash = tissue.hash;
    mesh_delta_fini(&whole);
    tissue_fini(&tissue);
    return hash;
}

static void keep_landed(void *user, const struct job_result *result) {
    struct tissue_figures *landed = user;
    if (result->outcome != JOB_NOTHING)
        *landed = result->figures;
}

// Runs a session again; figures are those of the last cut that landed in it.
static struct rerun *run_again(const char *trace, const struct scene *scene,
                               struct tissue_figures *out_landed) {
    struct trace_reader *reader;
    static struct trace_record record;
    struct session_output output;
    assert_int_equal(trace_reader_create(trace, &reader, NULL), RESULT_OK);
    struct rerun *rerun = rerun_create(scene, &trace_reader_header(reader)->settings);
    *out_landed = (struct tissue_figures){0};
    rerun_watch(rerun, keep_landed, out_landed);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        if (record.type == TRACE_STEP)
            rerun_step(rerun, &record, &output);
    trace_reader_destroy(&reader);
    return rerun;
}

static void assert_landed(const char *trace, const struct tissue_report *report) {
    struct tissue_figures landed;
    struct scene *scene = load_scene();
    struct rerun *rerun = run_again(trace, scene, &landed);
    assert_int_equal(report->figures[0].cuts, landed.cuts);
    rerun_destroy(&rerun);
    scene_destroy(&scene);
}

static void assert_was_cut(const char *trace, const struct tissue_report *report) {
    struct tissue_figures landed;
    struct scene *scene = load_scene();
    struct rerun *rerun = run_again(trace, scene, &landed);
    const struct operation *operation = rerun_operation(rerun);
    assert_int_equal(report->figures[0].mesh_number, operation_figures(operation, 0)->mesh_number);
    assert_int_equal(report->mesh_hashes[0], hash_of(operation_mesh(operation, 0)));
    rerun_destroy(&rerun);
    scene_destroy(&scene);
}

// ---- the tests ----------------------------------------------------------------------------------

static void a_job_that_is_asked_for_as_another_lands_does_not_overtake_it(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    hall_shave(sessions);
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    struct tissue_report report = hall_last_tissues(sessions);
    struct station_status status = hall_status(sessions);
    sessions_destroy(&sessions);
    assert_true(report.figures[0].cuts >= 5);
    assert_was_cut(status.about.trace, &report);
}

static void a_reset_while_a_cut_is_on_its_way_makes_the_mesh_whole(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    uint64_t whole = hall_last_tissues(sessions).mesh_hashes[0];
    for (int i = 0; i < 3; i++) {
        hall_shave(sessions);
        hall_command(sessions, arthron_Command_Kind_RESET);
    }
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    struct tissue_report report = hall_last_tissues(sessions);
    struct station_status status = hall_status(sessions);
    sessions_destroy(&sessions);
    assert_int_equal(report.figures[0].cuts, 0);
    assert_int_equal(report.mesh_hashes[0], whole);
    assert_was_cut(status.about.trace, &report);
}

// The burr still runs when the session is stopped.
static void a_session_that_is_stopped_has_recorded_all_that_is_shown_as_cut(void **state) {
    (void)state;
    enum { ROUNDS = 6, STEPS = 40 };
    static struct tissue_report shown[ROUNDS];
    static struct station_status was[ROUNDS];
    struct sessions *sessions = hall_open();
    int cut = 0;
    hall_join(sessions);
    for (int i = 0; i < ROUNDS; i++) {
        for (int k = 0; k < STEPS; k++)
            hall_frame(sessions,
                       (vec3){-19, -14 + 28.0 * (k * ROUNDS + i) / (STEPS * ROUNDS), -11});
        hall_wait_ms(1 + 6 * i);
        was[i] = hall_status(sessions);
        hall_command(sessions, arthron_Command_Kind_STOP);
        shown[i] = hall_last_tissues(sessions);
        hall_command(sessions, arthron_Command_Kind_START);
    }
    sessions_destroy(&sessions);
    for (int i = 0; i < ROUNDS; i++) {
        cut += shown[i].figures[0].cuts > 0;
        assert_landed(was[i].about.trace, &shown[i]);
    }
    assert_true(cut > ROUNDS / 2);
}

static void a_reset_is_answered_when_it_is_done(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    const atomic_uint_fast64_t *steps = &runtime_counts(sessions_runtime(sessions), 0)->steps;
    hall_join(sessions);
    for (int i = 0; i < 20; i++) {
        uint64_t before = atomic_load(steps);
        hall_command(sessions, arthron_Command_Kind_RESET);
        assert_true(atomic_load(steps) > before);
    }
    sessions_destroy(&sessions);
}

struct asker {
    struct sessions *sessions;
    pthread_t thread;
    arthron_CommandReply reply;
};

static void *ask_for_undo(void *user) {
    struct asker *asker = user;
    const arthron_Command command = {.kind = arthron_Command_Kind_UNDO, .station = "room-1"};
    sessions_command(asker->sessions, "otto", &command, &asker->reply);
    return NULL;
}

// In place of the hall's.
static void save_case(bool cuttable) {
    char folder[256];
    struct knee_case *knee = box_knee();
    struct case_group *meniscus = case_group(knee, "meniscus_medial");
    meniscus->cuttable = cuttable;
    if (!cuttable)
        meniscus->lesion.tear.part_count = meniscus->lesion.plan.part_count = 0;
    snprintf(folder, sizeof folder, "%s/case", hall_dir);
    assert_int_equal(case_save(knee, folder, NULL), RESULT_OK);
    case_destroy(&knee);
}

// Who is told that something was undone is told of no other's cuts.
static void of_undos_at_once_each_has_its_own_answer(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    static struct asker askers[4];
    hall_join(sessions);
    for (int i = 0; i < 5; i++) { // so that one is left
        hall_shave_part(sessions, i / 5.0, (i + 1) / 5.0);
        hall_command(sessions, arthron_Command_Kind_PAUSE); // ends the stroke
        hall_command(sessions, arthron_Command_Kind_START);
    }
    uint32_t before = hall_last_tissues(sessions).figures[0].cuts, undone = 0;
    for (int i = 0; i < 4; i++) {
        askers[i].sessions = sessions;
        assert_int_equal(pthread_create(&askers[i].thread, NULL, ask_for_undo, &askers[i]), 0);
    }
    int done = 0;
    for (int i = 0; i < 4; i++) {
        pthread_join(askers[i].thread, NULL);
        const arthron_CommandReply *reply = &askers[i].reply;
        assert_int_equal(reply->ok, reply->has_undone);
        if (!reply->ok)
            assert_string_equal(reply->text, "station room-1: an undo is on its way");
        undone += reply->ok ? reply->undone.cuts : 0;
        done += reply->ok;
    }
    assert_true(done >= 1 && undone > 0);
    assert_int_equal(hall_last_tissues(sessions).figures[0].cuts, before - undone);
    hall_command(sessions, arthron_Command_Kind_UNDO); // the next one is taken
    sessions_destroy(&sessions);
}

static void after_an_undo_is_answered_the_tissue_that_it_left_is_shown(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    for (int i = 0; i < 8; i++) {
        hall_shave_part(sessions, i / 8.0, (i + 1) / 8.0);
        hall_command(sessions, arthron_Command_Kind_PAUSE); // ends the stroke
        hall_command(sessions, arthron_Command_Kind_START);
    }
    struct tissue_report before = hall_last_tissues(sessions);
    while (before.figures[0].cuts) {
        const arthron_CommandReply *reply = hall_try(sessions, arthron_Command_Kind_UNDO);
        struct tissue_report now = hall_tissues(sessions);
        assert_true(reply->ok && reply->undone.cuts > 0);
        assert_int_equal(now.figures[0].cuts, before.figures[0].cuts - reply->undone.cuts);
        assert_int_equal(now.figures[0].mesh_number, before.figures[0].mesh_number + 1);
        before = now;
    }
    sessions_destroy(&sessions);
}

// What the reset made void is no answer to whoever asks next.
static void an_undo_behind_a_reset_has_nothing_to_undo(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    hall_shave(sessions);
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    hall_last_tissues(sessions);
    runtime_input(sessions_runtime(sessions), 0, INPUT_UNDO, 0);
    runtime_input(sessions_runtime(sessions), 0, INPUT_RESET, 0);
    const arthron_CommandReply *reply = hall_try(sessions, arthron_Command_Kind_UNDO);
    assert_false(reply->ok);
    assert_string_equal(reply->text, "station room-1: there is no cut to be undone");
    sessions_destroy(&sessions);
}

// As one whose asker has given it up, because the worker took too long.
static void an_undo_that_was_given_up_answers_no_other(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    for (int i = 0; i < 2; i++) { // the second stroke is the shorter one
        hall_shave_part(sessions, i * 0.8, 0.8 + i * 0.2);
        hall_command(sessions, arthron_Command_Kind_PAUSE); // ends the stroke
        hall_last_tissues(sessions);
        hall_command(sessions, arthron_Command_Kind_START);
    }
    uint32_t before = hall_last_tissues(sessions).figures[0].cuts;
    runtime_input(sessions_runtime(sessions), 0, INPUT_UNDO, 0);
    const arthron_CommandReply *reply = hall_try(sessions, arthron_Command_Kind_UNDO);
    uint32_t left = hall_last_tissues(sessions).figures[0].cuts;
    if (reply->ok) { // the other one had landed
        assert_true(reply->undone.cuts > before / 2);
        assert_int_equal(left, 0);
    } else {
        assert_string_equal(reply->text,
                            "station room-1: an undo is on its way, or its session ended");
        assert_true(left > before / 2 && left < before);
    }
    sessions_destroy(&sessions);
}

// As one whose asker has given it up.
static void a_reset_answers_the_undo_that_it_makes_void(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    static struct asker asker;
    asker.sessions = sessions;
    hall_join(sessions);
    for (int i = 0; i < 400; i++) // more than is cut by then: the undo waits for it
        hall_frame(sessions, (vec3){-19, -14 + 28.0 * i / 400, -11});
    assert_int_equal(pthread_create(&asker.thread, NULL, ask_for_undo, &asker), 0);
    hall_wait_ms(10);
    hall_hold_commands(sessions); // when the worker has taken the undo
    runtime_input(sessions_runtime(sessions), 0, INPUT_RESET, 0);
    hall_let_commands_go(sessions);
    pthread_join(asker.thread, NULL);
    if (!asker.reply.ok)
        assert_string_equal(asker.reply.text, "station room-1: there is no cut to be undone");
    sessions_destroy(&sessions);
}

static void where_nothing_can_be_cut_an_undo_is_refused_each_time(void **state) {
    (void)state;
    const arthron_Command command = {.kind = arthron_Command_Kind_UNDO, .station = "room-1"};
    static arthron_CommandReply reply;
    save_case(false);
    struct sessions *sessions = hall_open();
    save_case(true);
    hall_join(sessions);
    for (int i = 0; i < 2; i++) {
        sessions_command(sessions, "otto", &command, &reply);
        assert_false(reply.ok);
        assert_string_equal(reply.text, "station room-1: there is no cut to be undone");
    }
    sessions_destroy(&sessions);
}

static void a_server_that_ends_waits_for_no_copy(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    static arthron_CommandReply reply;
    arthron_Command copy = {.kind = arthron_Command_Kind_COPY, .station = "room-1"};
    hall_join(sessions);
    hall_shave_part(sessions, 0, 0.5);
    hall_command(sessions, arthron_Command_Kind_STOP);
    snprintf(copy.from, sizeof copy.from, "%s", hall_status(sessions).about.trace);
    sessions_command(sessions, "otto", &copy, &reply);
    assert_true(reply.ok);
    sessions_break_off(sessions);
    sessions_command(sessions, "otto", &copy, &reply);
    assert_false(reply.ok);
    assert_non_null(strstr(reply.text, "the server ends"));
    sessions_destroy(&sessions);
}

static void cuts_are_not_reported_for_another_case(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    hall_shave(sessions);
    assert_true(hall_last_tissues(sessions).figures[0].cuts > 0);
    hall_leave(sessions);
    hall_command(sessions, arthron_Command_Kind_CASE);
    const arthron_CommandReply *reply = hall_command(sessions, arthron_Command_Kind_SHOW);
    assert_string_equal(reply->sessions[0].case_name, "boxes1");
    assert_int_equal(reply->resections_count, 1);
    assert_int_equal(reply->resections[0].cuts, 0);
    sessions_destroy(&sessions);
}

// By its worker, or by the one who was faster.
static void stopping_a_session_that_just_ended_does_not_say_that_it_goes_on(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    for (int i = 0; i < 20; i++) {
        runtime_input(sessions_runtime(sessions), 0, INPUT_STOP, 0);
        const arthron_CommandReply *reply = hall_try(sessions, arthron_Command_Kind_STOP);
        if (!reply->ok)
            assert_string_equal(reply->text, "station room-1 has no session");
        hall_command(sessions, arthron_Command_Kind_START);
    }
    sessions_destroy(&sessions);
}

static void a_case_is_changed_whoever_opens_the_session(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    for (int i = 0; i < 300; i++)
        hall_command(sessions, arthron_Command_Kind_CASE);
    sessions_destroy(&sessions);
}

// ---- a cut on its way ---------------------------------------------------------------------------

// One that stays on its way until hall_let_cuts_go.
static void hold_a_cut(struct sessions *sessions) {
    hall_hold_cuts(sessions);
    for (int i = 0; i < 200; i++)
        hall_frame(sessions, (vec3){-19, -14 + 28.0 * i / 400, -11});
    hall_wait_ms(300);
    assert_true(hall_is_cutting(sessions));
}

static void without_a_lease_a_cut_lands_with_the_next_fresh_frame(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_lease(sessions);
    hall_join(sessions);
    hold_a_cut(sessions);
    atomic_store(&hall_serve_until_ns, clock_now_ns());
    hall_wait_ms(1200);
    uint64_t before = atomic_load(&hall_counts(sessions)->steps);
    hall_let_cuts_go(sessions);
    hall_wait_ms(300);
    assert_int_equal(atomic_load(&hall_counts(sessions)->steps), before);
    assert_true(hall_is_cutting(sessions));
    hall_frame(sessions, (vec3){60, 60, 60});
    for (int i = 0; i < 10000 && atomic_load(&hall_counts(sessions)->steps) < before + 2; i++)
        hall_wait_ms(1);
    assert_true(atomic_load(&hall_counts(sessions)->steps) >= before + 2);
    atomic_store(&hall_serve_until_ns, INT64_MAX);
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    struct tissue_report report = hall_last_tissues(sessions);
    struct station_status status = hall_status(sessions);
    sessions_destroy(&sessions);
    assert_was_cut(status.about.trace, &report);
}

static void *stop(void *argument) {
    hall_try(argument, arthron_Command_Kind_STOP);
    return NULL;
}

static void a_stop_that_waits_for_a_cut_waits_for_the_lease_too(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    pthread_t thread;
    hall_lease(sessions);
    hall_join(sessions);
    hold_a_cut(sessions);
    assert_int_equal(pthread_create(&thread, NULL, stop, sessions), 0);
    hall_wait_ms(200);
    atomic_store(&hall_serve_until_ns, clock_now_ns());
    hall_let_cuts_go(sessions);
    hall_wait_ms(300);
    assert_int_equal(hall_status(sessions).phase, SLOT_ENDING);
    atomic_store(&hall_serve_until_ns, INT64_MAX);
    pthread_join(thread, NULL);
    assert_int_equal(hall_status(sessions).phase, SLOT_EMPTY);
    sessions_destroy(&sessions);
}

static bool has_ended_in(struct sessions *sessions, uint64_t session, int64_t wait_ns) {
    return station_slot_wait_ended(&sessions->slots[0], session, clock_now_ns() + wait_ns);
}

static void a_session_is_handed_over_once_its_cut_is_done(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct runtime *runtime = sessions_runtime(sessions);
    hall_join(sessions);
    struct station_status before = hall_status(sessions);
    hold_a_cut(sessions);
    hall_leave(sessions);
    assert_true(runtime_hand_over(runtime, 0));
    assert_false(has_ended_in(sessions, before.about.serial, NS_PER_S / 5));
    hall_let_cuts_go(sessions);
    assert_true(has_ended_in(sessions, before.about.serial, 10 * NS_PER_S));
    assert_true(runtime_hand_over(runtime, 0));
    hall_wait_ms(100);
    sessions_destroy(&sessions);

    sessions = hall_open();
    hall_join(sessions);
    struct station_status after = hall_status(sessions);
    assert_string_equal(after.about.trace, before.about.trace);
    assert_memory_equal(after.session_id, before.session_id, sizeof after.session_id);
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    struct tissue_report report = hall_last_tissues(sessions);
    sessions_destroy(&sessions);
    assert_true(report.figures[0].cuts > 0);
    assert_was_cut(after.about.trace, &report);
}

static void a_session_that_follows_one_that_was_handed_over_has_none_of_its_cuts(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    for (int i = 0; i < 4; i++) {
        uint64_t serial = hall_status(sessions).about.serial;
        hold_a_cut(sessions);
        assert_true(runtime_hand_over(sessions_runtime(sessions), 0));
        hall_let_cuts_go(sessions);
        assert_true(has_ended_in(sessions, serial, 10 * NS_PER_S));
        station_slot_set_state(&sessions->slots[0], serial, SESSION_CLOSED);
        hall_command(sessions, arthron_Command_Kind_START);
        assert_int_not_equal(hall_status(sessions).about.serial, serial);
    }
    struct tissue_report whole = hall_last_tissues(sessions);
    assert_int_equal(whole.figures[0].cuts, 0);
    hall_shave(sessions);
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    struct tissue_report report = hall_last_tissues(sessions);
    struct station_status status = hall_status(sessions);
    sessions_destroy(&sessions);
    assert_was_cut(status.about.trace, &report);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_job_that_is_asked_for_as_another_lands_does_not_overtake_it),
        cmocka_unit_test(a_reset_while_a_cut_is_on_its_way_makes_the_mesh_whole),
        cmocka_unit_test(a_reset_is_answered_when_it_is_done),
        cmocka_unit_test(a_session_that_is_stopped_has_recorded_all_that_is_shown_as_cut),
        cmocka_unit_test(of_undos_at_once_each_has_its_own_answer),
        cmocka_unit_test(after_an_undo_is_answered_the_tissue_that_it_left_is_shown),
        cmocka_unit_test(an_undo_behind_a_reset_has_nothing_to_undo),
        cmocka_unit_test(an_undo_that_was_given_up_answers_no_other),
        cmocka_unit_test(a_reset_answers_the_undo_that_it_makes_void),
        cmocka_unit_test(where_nothing_can_be_cut_an_undo_is_refused_each_time),
        cmocka_unit_test(a_server_that_ends_waits_for_no_copy),
        cmocka_unit_test(stopping_a_session_that_just_ended_does_not_say_that_it_goes_on),
        cmocka_unit_test(a_case_is_changed_whoever_opens_the_session),
        cmocka_unit_test(cuts_are_not_reported_for_another_case),
        cmocka_unit_test(without_a_lease_a_cut_lands_with_the_next_fresh_frame),
        cmocka_unit_test(a_stop_that_waits_for_a_cut_waits_for_the_lease_too),
        cmocka_unit_test(a_session_is_handed_over_once_its_cut_is_done),
        cmocka_unit_test(a_session_that_follows_one_that_was_handed_over_has_none_of_its_cuts),
    };
    return cmocka_run_group_tests_name("cut_worker", tests, hall_make, hall_remove);
}
