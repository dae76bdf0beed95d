// Attempts in a running session: begun and left by command, judged, told, in the trace, over a
// restart.
#include "runtime/attempts.h"

#include "judging/judging.h"
#include "runtime/attempt_state.h"
#include "runtime/parts.h"
#include "sessions/parts.h"
#include "test.h"
#include "unit/hall.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#define TASK                                                                                       \
    "[task]\ntitle = Rest\nbriefing = Hold the knee.\nlimit_s = 60\n[pass]\ntime_s = 30\n"         \
    "source = for a test\n[goal rest]\nflexion_deg = -20 160\nhold_s = %g\n"                       \
    "[error deep]\ndeep_mm = 1\nsentinel = yes\n"

static int make(void **state) {
    static const struct {
        const char *name;
        double hold_s;
    } tasks[] = {{"soon", 0.2}, {"late", 50}};
    char path[FOLDER_MAX + 64];
    if (hall_make(state) != 0)
        return -1;
    snprintf(path, sizeof path, "%s/tasks", hall_dir);
    mkdir(path, 0700);
    for (int i = 0; i < 2; i++) {
        snprintf(path, sizeof path, "%s/tasks/%s.ini", hall_dir, tasks[i].name);
        FILE *file = fopen(path, "w");
        fprintf(file, TASK, tasks[i].hold_s);
        fclose(file);
    }
    return 0;
}

static struct sessions *begin(void) {
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    return sessions;
}

static const arthron_CommandReply *ask(struct sessions *sessions, arthron_Command command) {
    static arthron_CommandReply reply;
    snprintf(command.station, sizeof command.station, "room-1");
    sessions_command(sessions, "otto", &command, &reply);
    return &reply;
}

static const arthron_CommandReply *ask_for(struct sessions *sessions, const char *task) {
    arthron_Command command = {.kind = arthron_Command_Kind_BEGIN,
                               .hand = arthron_AttemptState_Hand_LEFT_HAND};
    snprintf(command.task, sizeof command.task, "%s", task);
    return ask(sessions, command);
}

static void begin_task(struct sessions *sessions, const char *task) {
    const arthron_CommandReply *reply = ask_for(sessions, task);
    if (!reply->ok)
        fail_msg("%s", reply->text);
}

static arthron_AttemptState shown(struct sessions *sessions) {
    struct live_attempt attempt;
    runtime_shown_attempt(sessions->runtime, 0, &attempt);
    return attempt.state;
}

static arthron_AttemptState wait_for_end(struct sessions *sessions) {
    arthron_AttemptState state = shown(sessions);
    for (int i = 0; i < 10000 && state.end == arthron_AttemptState_End_RUNS; i++) {
        hall_wait_ms(1);
        state = shown(sessions);
    }
    assert_int_not_equal(state.end, arthron_AttemptState_End_RUNS);
    return state;
}

#define MOST 8

struct found {
    int count, same;
    struct {
        struct trace_attempt begun;
        struct trace_outcome ended;
        struct attempt attempt;
    } all[MOST];
};

static void take(void *user, const struct judged_attempt *judged) {
    struct found *found = user;
    assert_true(found->count < MOST);
    found->all[found->count].begun = *judged->begun;
    if (judged->ended)
        found->all[found->count].ended = *judged->ended;
    found->all[found->count++].attempt = judged->attempt;
    found->same += judged->is_same;
}

static struct found *judge(struct sessions *sessions, const char *trace) {
    static struct found found;
    struct attempt_taker taker = {.user = &found, .take = take};
    struct trace_reader *reader;
    struct error err;
    memset(&found, 0, sizeof found);
    assert_ok(trace_reader_create(trace, &reader, &err));
    judge_trace(reader, sessions->scenes[0], &taker, &err);
    trace_reader_destroy(&reader);
    assert_int_equal(found.same, found.count);
    return &found;
}

// What was appended comes into the file within 20 ms.
static struct found *judge_all(struct sessions *sessions, int count) {
    struct station_status status = hall_status(sessions);
    struct found *found = judge(sessions, status.about.trace);
    for (int i = 0; i < 1000 && (found->count < count || !found->all[count - 1].ended.number);
         i++) {
        hall_wait_ms(10);
        found = judge(sessions, status.about.trace);
    }
    assert_int_equal(found->count, count);
    return found;
}

// ---- tests --------------------------------------------------------------------------------------

static void an_attempt_is_judged_told_and_in_the_trace(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    begin_task(sessions, "soon");
    arthron_AttemptState attempt = wait_for_end(sessions);
    assert_int_equal(attempt.number, 1);
    assert_string_equal(attempt.title, "Rest");
    assert_int_equal(attempt.hand, arthron_AttemptState_Hand_LEFT_HAND);
    assert_int_equal(attempt.end, arthron_AttemptState_End_DONE);
    assert_int_equal(attempt.verdict, arthron_AttemptState_Verdict_PASSED);
    assert_int_equal(attempt.goals_count, 1);
    assert_true(attempt.goals[0].has_met_ns && attempt.goals[0].met_ns >= 200000000);
    assert_int_equal(attempt.errors_count, 1);
    assert_true(attempt.begun_step > 0 && attempt.last_step > attempt.begun_step);
    begin_task(sessions, "soon");
    attempt = wait_for_end(sessions);
    assert_int_equal(attempt.number, 2);
    const struct found *found = judge_all(sessions, 2);
    assert_int_equal(found->all[1].ended.last_step, attempt.last_step);
    assert_int_equal(found->all[1].ended.time_ns, attempt.time_ns);
    assert_string_equal(found->all[1].begun.task, "soon");
    sessions_destroy(&sessions);
}

static void one_runs_at_a_time_until_it_is_left(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    arthron_Command leave = {.kind = arthron_Command_Kind_LEAVE};
    assert_string_equal(ask(sessions, leave)->text, "station room-1: no attempt runs");
    assert_string_equal(ask_for(sessions, "none")->text, "there is no task none");
    begin_task(sessions, "late");
    assert_string_equal(ask_for(sessions, "soon")->text, "station room-1: an attempt runs: late");
    assert_true(ask(sessions, leave)->ok);
    assert_int_equal(wait_for_end(sessions).end, arthron_AttemptState_End_STOPPED);
    assert_string_equal(ask(sessions, leave)->text, "station room-1: no attempt runs");
    assert_int_equal(judge_all(sessions, 1)->all[0].ended.end, ATTEMPT_STOPPED);
    sessions_destroy(&sessions);
}

static void without_a_lease_none_is_begun_or_left(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_lease(sessions);
    hall_join(sessions);
    atomic_store(&hall_serve_until_ns, 0);
    assert_false(ask_for(sessions, "late")->ok);
    assert_int_equal(shown(sessions).number, 0);
    atomic_store(&hall_serve_until_ns, INT64_MAX);
    begin_task(sessions, "late");
    atomic_store(&hall_serve_until_ns, 0);
    assert_false(hall_try(sessions, arthron_Command_Kind_LEAVE)->ok);
    assert_int_equal(shown(sessions).end, arthron_AttemptState_End_RUNS);
    sessions_destroy(&sessions);
}

static void a_reset_and_the_end_of_the_session_stop_it(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    begin_task(sessions, "late");
    hall_command(sessions, arthron_Command_Kind_RESET);
    assert_int_equal(wait_for_end(sessions).end, arthron_AttemptState_End_STOPPED);
    begin_task(sessions, "late");
    hall_command(sessions, arthron_Command_Kind_STOP);
    assert_int_equal(wait_for_end(sessions).end, arthron_AttemptState_End_STOPPED);
    const struct found *found = judge_all(sessions, 2);
    assert_int_equal(found->count, 2);
    assert_int_equal(found->all[1].ended.verdict, VERDICT_NOT_YET);
    assert_string_equal(ask_for(sessions, "soon")->text, "station room-1 has no session");
    sessions_destroy(&sessions);
}

static int resets(const char *trace) {
    struct trace_reader *reader;
    struct trace_record record;
    struct error err;
    int count = 0;
    assert_ok(trace_reader_create(trace, &reader, &err));
    while (trace_read(reader, &record, &err) == RESULT_OK)
        count += record.type == TRACE_STEP && record.input.kind == INPUT_RESET;
    trace_reader_destroy(&reader);
    return count;
}

static void what_was_done_before_is_no_part_of_it(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    begin_task(sessions, "soon");
    wait_for_end(sessions);
    assert_int_equal(resets(hall_status(sessions).about.trace), 0);
    hall_shave_part(sessions, 0, 0.3);
    assert_true(hall_last_tissues(sessions).figures[0].cuts > 0);
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    begin_task(sessions, "late");
    assert_int_equal(hall_last_tissues(sessions).figures[0].cuts, 0);
    assert_int_equal(hall_status(sessions).state, SESSION_PAUSED);
    ask(sessions, (arthron_Command){.kind = arthron_Command_Kind_LEAVE});
    hall_command(sessions, arthron_Command_Kind_START);
    begin_task(sessions, "soon");
    wait_for_end(sessions);
    const struct found *found = judge_all(sessions, 3);
    assert_int_equal(found->all[1].attempt.cut, 0);
    assert_int_equal(found->all[1].ended.time_ns, 0);
    assert_int_equal(resets(hall_status(sessions).about.trace), 1);
    sessions_destroy(&sessions);
}

static void a_pause_does_not_count(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    begin_task(sessions, "late");
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    struct step_snapshot before, after;
    runtime_snapshot(sessions->runtime, 0, &before);
    hall_wait_ms(1200);
    hall_command(sessions, arthron_Command_Kind_START);
    do
        runtime_snapshot(sessions->runtime, 0, &after);
    while (after.attempt_ns == before.attempt_ns);
    assert_int_equal(after.attempt, 1);
    assert_true(after.attempt_ns - before.attempt_ns < 1100000000);
    sessions_destroy(&sessions);
}

static void the_next_server_goes_on_with_it(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    begin_task(sessions, "soon");
    wait_for_end(sessions);
    begin_task(sessions, "late");
    hall_wait_ms(100);
    int64_t begun_ns = sessions->runtime->stations[0].session->attempt->begun_ns;
    sessions_hand_over(&sessions);
    sessions = hall_open();
    arthron_AttemptState attempt = shown(sessions);
    for (int i = 0; i < 10000 && !attempt.number; i++) {
        hall_wait_ms(1);
        attempt = shown(sessions);
    }
    assert_true(sessions->runtime->stations[0].session->attempt->begun_ns == begun_ns);
    assert_int_equal(attempt.number, 2);
    assert_string_equal(attempt.task, "late");
    assert_int_equal(attempt.end, arthron_AttemptState_End_RUNS);
    assert_true(attempt.time_ns > 0);
    ask(sessions, (arthron_Command){.kind = arthron_Command_Kind_LEAVE});
    begin_task(sessions, "soon");
    assert_int_equal(shown(sessions).number, 3);
    wait_for_end(sessions);
    assert_int_equal(judge_all(sessions, 3)->all[1].ended.end, ATTEMPT_STOPPED);
    sessions_destroy(&sessions);
}

// As a newer server refuses it. The paused session's worker writes nothing.
static void begin_odd_task(struct sessions *sessions) {
    const struct trace_attempt odd = {
        .number = 1, .task = "odd", .pass_time_s = 1, .size = 6, .text = "[task]"};
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    hall_wait_ms(20);
    assert_true(trace_append_begun(sessions->runtime->stations[0].session->trace, &odd));
    hall_wait_ms(20);
}

static void one_whose_task_is_refused_keeps_no_session_from_going_on(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    begin_odd_task(sessions);
    sessions_hand_over(&sessions);
    sessions = hall_open();
    hall_connect(sessions, 2);
    while (hall_status(sessions).phase != SLOT_ATTACHED)
        hall_wait_ms(1);
    hall_command(sessions, arthron_Command_Kind_START);
    begin_task(sessions, "soon");
    assert_int_equal(wait_for_end(sessions).number, 2);
    const struct found *found = judge_all(sessions, 1);
    assert_int_equal(found->all[0].begun.number, 2);
    assert_int_equal(found->all[0].ended.end, ATTEMPT_DONE);
    sessions_destroy(&sessions);
}

static void a_trace_has_so_many_and_no_more(void **state) {
    (void)state;
    struct trace_attempt begun = {
        .number = TRACE_ATTEMPTS_MAX, .task = "odd", .pass_time_s = 1, .size = 6, .text = "[task]"};
    assert_true(trace_attempt_is_valid(&begun));
    begun.number++;
    assert_false(trace_attempt_is_valid(&begun));
    struct sessions *sessions = begin();
    begin_task(sessions, "soon");
    wait_for_end(sessions);
    sessions->runtime->stations[0].session->attempts = TRACE_ATTEMPTS_MAX;
    assert_false(ask_for(sessions, "soon")->ok);
    sessions_destroy(&sessions);
}

static const arthron_CommandReply *ask_as(struct sessions *sessions, arthron_Command_Kind kind,
                                          const char *trainee) {
    arthron_Command command = {.kind = kind};
    snprintf(command.trainee, sizeof command.trainee, "%s", trainee);
    return ask(sessions, command);
}

static void a_trainee_takes_a_station_that_is_free(void **state) {
    (void)state;
    const arthron_Command_Kind take = arthron_Command_Kind_TAKE, stop = arthron_Command_Kind_STOP;
    struct sessions *sessions = begin();
    assert_true(ask_as(sessions, arthron_Command_Kind_ASSIGN, "bert")->ok);
    assert_string_equal(ask_as(sessions, take, "eva")->text,
                        "station room-1: an instructor keeps it for somebody else");
    assert_true(ask_as(sessions, arthron_Command_Kind_ASSIGN, "eva")->ok);
    assert_true(ask_as(sessions, take, "eva")->ok);
    assert_string_equal(hall_status(sessions).about.trainee, "eva");
    assert_true(ask_as(sessions, take, "eva")->ok); // it goes on
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    assert_string_equal(ask_as(sessions, take, "eva")->text,
                        "station room-1: an instructor paused its session");
    hall_command(sessions, arthron_Command_Kind_START);
    assert_string_equal(ask_as(sessions, take, "bert")->text,
                        "station room-1: somebody else trains there");
    assert_string_equal(ask_as(sessions, stop, "bert")->text,
                        "station room-1: it has no session of yours");
    assert_true(ask_as(sessions, stop, "eva")->ok);
    assert_true(ask_as(sessions, take, "bert")->ok);
    assert_string_equal(hall_status(sessions).about.trainee, "bert");
    sessions_destroy(&sessions);
}

static void an_exam_needs_records(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    arthron_Command command = {.kind = arthron_Command_Kind_BEGIN,
                               .task = "late",
                               .purpose = arthron_AttemptState_Purpose_EXAM};
    assert_string_equal(ask(sessions, command)->text,
                        "station room-1: this server has no records for an exam");
    sessions_destroy(&sessions);
}

static void who_trains_may_practise_in_an_own_session_alone(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    arthron_Command command = {
        .kind = arthron_Command_Kind_BEGIN, .task = "late", .trainee = "eva"};
    assert_string_equal(ask(sessions, command)->text, "station room-1: it has no session of yours");
    arthron_Command assign = {.kind = arthron_Command_Kind_ASSIGN, .trainee = "eva"};
    assert_true(ask(sessions, assign)->ok);
    hall_command(sessions, arthron_Command_Kind_STOP);
    hall_command(sessions, arthron_Command_Kind_START);
    command.purpose = arthron_AttemptState_Purpose_EXAM;
    assert_string_equal(ask(sessions, command)->text, "station room-1: an exam is for instructors");
    command.purpose = arthron_AttemptState_Purpose_PRACTICE;
    assert_true(ask(sessions, command)->ok);
    arthron_Command leave = {.kind = arthron_Command_Kind_LEAVE, .trainee = "otto"};
    assert_string_equal(ask(sessions, leave)->text, "station room-1: it has no session of yours");
    snprintf(leave.trainee, sizeof leave.trainee, "eva");
    assert_true(ask(sessions, leave)->ok);
    assert_int_equal(wait_for_end(sessions).end, arthron_AttemptState_End_LEFT);
    assert_true(ask(sessions, command)->ok);
    assert_true(ask_as(sessions, arthron_Command_Kind_STOP, "eva")->ok); // and goes home
    assert_int_equal(wait_for_end(sessions).end, arthron_AttemptState_End_LEFT);
    const struct found *found = judge_all(sessions, 2);
    assert_int_equal(found->all[0].attempt.end, ATTEMPT_LEFT);
    assert_int_equal(found->all[1].ended.end, ATTEMPT_LEFT);
    sessions_destroy(&sessions);
}

static bool runs(struct sessions *sessions) {
    return shown(sessions).end == arthron_AttemptState_End_RUNS;
}

static void a_pedal_that_is_held_ends_practice(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    hall_press(sessions, 1, MARKER_DONE, true); // and held from before
    hall_wait_ms(100);
    begin_task(sessions, "late");
    hall_wait_ms(1500);
    assert_true(runs(sessions));
    hall_press(sessions, 2, MARKER_DONE, true);
    hall_press(sessions, 3, "start", true);
    hall_wait_ms(300);
    hall_press(sessions, 4, MARKER_DONE, false); // too soon
    hall_wait_ms(1500);
    assert_true(runs(sessions));
    hall_press(sessions, 5, MARKER_DONE, true);
    hall_leave(sessions); // the release is lost
    hall_connect(sessions, 1);
    hall_wait_ms(1500);
    assert_true(runs(sessions));
    hall_press(sessions, 7, MARKER_DONE, true);
    assert_int_equal(wait_for_end(sessions).end, arthron_AttemptState_End_LEFT);
    assert_int_equal(judge_all(sessions, 1)->all[0].attempt.end, ATTEMPT_LEFT);
    sessions_destroy(&sessions);
}

static void a_pedal_ends_no_exam(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    begin_task(sessions, "late");
    sessions->runtime->stations[0].session->attempt->purpose = ATTEMPT_EXAM;
    hall_press(sessions, 1, MARKER_DONE, true);
    hall_wait_ms(1500);
    assert_true(runs(sessions));
    sessions_destroy(&sessions);
}

static void a_copy_has_none_of_them(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    begin_task(sessions, "late");
    hall_wait_ms(60);
    char id[33];
    struct station_status status = hall_status(sessions);
    for (int i = 0; i < 16; i++)
        snprintf(id + 2 * i, 3, "%02x", status.about.id[i]);
    arthron_Command copy = {.kind = arthron_Command_Kind_COPY};
    snprintf(copy.from, sizeof copy.from, "%s", id);
    const arthron_CommandReply *reply = ask(sessions, copy);
    if (!reply->ok)
        fail_msg("%s", reply->text);
    begin_task(sessions, "soon");
    assert_int_equal(wait_for_end(sessions).number, 1);
    assert_int_equal(judge_all(sessions, 1)->all[0].ended.end, ATTEMPT_DONE);
    sessions_destroy(&sessions);
}

static void an_exam_is_withheld_and_practice_is_not(void **state) {
    (void)state;
    arthron_AttemptState told = {.number = 1,
                                 .goals_count = 2,
                                 .errors_count = 1,
                                 .occurrences_count = 3,
                                 .time_ns = 5,
                                 .last_step = 6,
                                 .end = arthron_AttemptState_End_DONE,
                                 .verdict = arthron_AttemptState_Verdict_PASSED};
    attempt_state_withhold(&told);
    assert_int_equal(told.goals_count, 2);
    assert_int_equal(told.end, arthron_AttemptState_End_DONE);
    told.purpose = arthron_AttemptState_Purpose_EXAM;
    attempt_state_withhold(&told);
    assert_int_equal(told.goals_count + told.errors_count + told.occurrences_count, 0);
    assert_int_equal(told.verdict, arthron_AttemptState_Verdict_OPEN);
    assert_int_equal(told.end, arthron_AttemptState_End_ENDED);
    assert_int_equal(told.time_ns + (int64_t)told.last_step, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_attempt_is_judged_told_and_in_the_trace),
        cmocka_unit_test(one_runs_at_a_time_until_it_is_left),
        cmocka_unit_test(without_a_lease_none_is_begun_or_left),
        cmocka_unit_test(a_reset_and_the_end_of_the_session_stop_it),
        cmocka_unit_test(what_was_done_before_is_no_part_of_it),
        cmocka_unit_test(a_pause_does_not_count),
        cmocka_unit_test(the_next_server_goes_on_with_it),
        cmocka_unit_test(one_whose_task_is_refused_keeps_no_session_from_going_on),
        cmocka_unit_test(a_trace_has_so_many_and_no_more),
        cmocka_unit_test(a_trainee_takes_a_station_that_is_free),
        cmocka_unit_test(an_exam_needs_records),
        cmocka_unit_test(who_trains_may_practise_in_an_own_session_alone),
        cmocka_unit_test(a_pedal_that_is_held_ends_practice),
        cmocka_unit_test(a_pedal_ends_no_exam),
        cmocka_unit_test(a_copy_has_none_of_them),
        cmocka_unit_test(an_exam_is_withheld_and_practice_is_not),
    };
    return cmocka_run_group_tests(tests, make, hall_remove);
}
