// Stations that come and go, as the sessions see them.
#include "base/clock.h"
#include "runtime/parts.h"
#include "test.h"
#include "trace/state.h"
#include "unit/hall.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void assert_trace_is_of(const struct station_status *status) {
    struct trace_reader *reader;
    assert_int_equal(trace_reader_create(status->about.trace, &reader, NULL), RESULT_OK);
    assert_memory_equal(trace_reader_header(reader)->session_id, status->session_id, 16);
    trace_reader_destroy(&reader);
}

static void wait_until_attached(struct sessions *sessions) {
    while (hall_status(sessions).phase != SLOT_ATTACHED)
        hall_wait_ms(1);
}

// Also while its session is being opened.
static void a_station_is_told_the_id_that_its_session_has(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    for (int i = 0; i < 40; i++) {
        uint64_t run = (uint64_t)i + 1;
        arthron_Welcome first = hall_connect(sessions, run); // another run of its program
        if (i % 4)
            hall_wait_ms(i % 4);
        hall_leave(sessions);
        arthron_Welcome again = hall_connect(sessions, run);
        assert_memory_equal(again.session_id, first.session_id, sizeof first.session_id);
        wait_until_attached(sessions);
        struct station_status status = hall_status(sessions);
        assert_memory_equal(status.session_id, first.session_id, sizeof status.session_id);
        assert_trace_is_of(&status);
        hall_command(sessions, arthron_Command_Kind_STOP);
        hall_leave(sessions);
    }
    sessions_destroy(&sessions);
}

static void a_session_that_was_stopped_stays_stopped_when_the_link_blips(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_join(sessions);
    hall_command(sessions, arthron_Command_Kind_STOP);
    hall_leave(sessions);
    hall_connect(sessions, 1);
    hall_wait_ms(300);
    assert_int_equal(hall_status(sessions).phase, SLOT_EMPTY);
    hall_command(sessions, arthron_Command_Kind_START);
    assert_int_equal(hall_status(sessions).state, SESSION_RUNNING);
    sessions_destroy(&sessions);
}

// They are told apart from frames with values out of range, and from lost ones.
static void frames_that_find_no_room_are_counted_as_such(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct runtime *runtime = sessions_runtime(sessions);
    const struct station_counts *counts = runtime_counts(runtime, 0);
    const struct frame frame = {.number = 1};
    hall_join(sessions);
    for (int i = 0; i < 100000 && !atomic_load(&counts->frames_excess); i++)
        runtime_frame(runtime, 0, &frame, 0);
    assert_true(atomic_load(&counts->frames_excess) > 0);
    assert_int_equal(atomic_load(&counts->frames_invalid), 0);
    assert_int_equal(hall_command(sessions, arthron_Command_Kind_PAUSE)->sessions[0].state,
                     arthron_SessionState_PAUSED); // its worker is not starved
    sessions_destroy(&sessions);
}

static void a_station_that_has_gone_is_gone_whatever_else_it_said(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct runtime *runtime = sessions_runtime(sessions);
    const struct frame frame = {.number = 1};
    hall_join(sessions);
    for (int i = 0; i < 5000; i++)
        runtime_frame(runtime, 0, &frame, 0);
    hall_leave(sessions);
    const struct station_counts *counts = runtime_counts(runtime, 0);
    hall_wait_ms(100);
    uint64_t old = atomic_load(&counts->frames_old), early = atomic_load(&counts->frames_early);
    runtime_frame(runtime, 0, &frame, 0); // of a connection that is no more
    hall_wait_ms(100);
    assert_int_equal(atomic_load(&counts->frames_old), old);
    assert_int_equal(atomic_load(&counts->frames_early), early);
    sessions_destroy(&sessions);
}

// ---- a lease ------------------------------------------------------------------------------------

static const vec3 away = {60, 60, 60};

static uint64_t steps(struct sessions *sessions) {
    return atomic_load(&hall_counts(sessions)->steps);
}

static void assert_steps_after(struct sessions *sessions, uint64_t before) {
    for (int i = 0; i < 10000 && steps(sessions) == before; i++)
        hall_wait_ms(1);
    assert_true(steps(sessions) > before);
}

static void assert_steps(struct sessions *sessions) {
    assert_steps_after(sessions, steps(sessions));
}

static void assert_stands_still(struct sessions *sessions) {
    hall_wait_ms(100);
    uint64_t before = steps(sessions);
    hall_wait_ms(300);
    assert_int_equal(steps(sessions), before);
}

static void without_a_lease_a_session_goes_on_only_with_fresh_frames(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_lease(sessions);
    hall_join(sessions);
    assert_steps(sessions);
    atomic_store(&hall_serve_until_ns, clock_now_ns());
    assert_stands_still(sessions);
    uint64_t before = steps(sessions), old = atomic_load(&hall_counts(sessions)->frames_old);
    hall_frame_of(sessions, away, clock_now_ns() - 2 * NS_PER_S);
    for (int i = 0; i < 10000 && atomic_load(&hall_counts(sessions)->frames_old) == old; i++)
        hall_wait_ms(1);
    assert_int_equal(atomic_load(&hall_counts(sessions)->frames_old), old + 1);
    assert_int_equal(steps(sessions), before);
    hall_frame(sessions, away);
    assert_steps_after(sessions, before); // its one step may come before the next line is reached
    assert_int_equal(steps(sessions), before + 1);
    atomic_store(&hall_serve_until_ns, INT64_MAX);
    hall_frame_of(sessions, away, clock_now_ns() - 2 * NS_PER_S);
    assert_steps(sessions);
    sessions_destroy(&sessions);
}

static void without_a_lease_commands_are_refused(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_lease(sessions);
    hall_join(sessions);
    atomic_store(&hall_serve_until_ns, clock_now_ns());
    assert_false(hall_try(sessions, arthron_Command_Kind_PAUSE)->ok);
    assert_false(hall_try(sessions, arthron_Command_Kind_STOP)->ok);
    assert_int_equal(hall_status(sessions).state, SESSION_RUNNING);
    atomic_store(&hall_serve_until_ns, INT64_MAX);
    hall_command(sessions, arthron_Command_Kind_PAUSE);
    sessions_destroy(&sessions);
}

static void without_a_lease_a_deserted_session_does_not_end(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    hall_lease(sessions);
    sessions_runtime(sessions)->config.wait_s = 0;
    hall_join(sessions);
    atomic_store(&hall_serve_until_ns, clock_now_ns());
    hall_leave(sessions);
    hall_wait_ms(300);
    assert_int_equal(hall_status(sessions).state, SESSION_RUNNING);
    atomic_store(&hall_serve_until_ns, INT64_MAX);
    for (int i = 0; i < 10000 && hall_status(sessions).phase != SLOT_EMPTY; i++)
        hall_wait_ms(1);
    assert_int_equal(hall_status(sessions).phase, SLOT_EMPTY);
    sessions_destroy(&sessions);
}

// ---- states that are kept -----------------------------------------------------------------------

static struct {
    atomic_int count;
    char trace[TRACE_FILE_MAX];
    enum result result;
} kept;

static void note_kept(void *user, const char *trace) {
    struct trace_state state = {0};
    assert_non_null(user);
    kept.result = trace_state_read(trace, &state, NULL);
    free(state.content);
    snprintf(kept.trace, sizeof kept.trace, "%s", trace);
    atomic_fetch_add(&kept.count, 1);
}

static struct sessions *begin_keeping(bool at_once) {
    struct sessions *sessions = hall_open();
    atomic_store(&kept.count, 0);
    sessions_runtime(sessions)->config.keep_at_once = at_once;
    sessions_runtime(sessions)->config.kept = note_kept;
    hall_join(sessions);
    return sessions;
}

static void a_session_is_kept_at_once_where_that_is_wanted(void **state) {
    (void)state;
    struct sessions *sessions = begin_keeping(true);
    for (int i = 0; i < 10000 && !atomic_load(&kept.count); i++)
        hall_wait_ms(1);
    assert_int_equal(atomic_load(&kept.count), 1);
    assert_int_equal(kept.result, RESULT_OK);
    assert_string_equal(kept.trace, hall_status(sessions).about.trace);
    hall_wait_ms(500);
    assert_int_equal(atomic_load(&kept.count), 1); // then as usual
    sessions_destroy(&sessions);
}

static void else_a_session_is_not_kept_at_once(void **state) {
    (void)state;
    struct sessions *sessions = begin_keeping(false);
    hall_wait_ms(500);
    assert_int_equal(atomic_load(&kept.count), 0);
    sessions_destroy(&sessions);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_station_is_told_the_id_that_its_session_has),
        cmocka_unit_test(a_session_that_was_stopped_stays_stopped_when_the_link_blips),
        cmocka_unit_test(frames_that_find_no_room_are_counted_as_such),
        cmocka_unit_test(a_station_that_has_gone_is_gone_whatever_else_it_said),
        cmocka_unit_test(without_a_lease_a_session_goes_on_only_with_fresh_frames),
        cmocka_unit_test(without_a_lease_commands_are_refused),
        cmocka_unit_test(without_a_lease_a_deserted_session_does_not_end),
        cmocka_unit_test(a_session_is_kept_at_once_where_that_is_wanted),
        cmocka_unit_test(else_a_session_is_not_kept_at_once),
    };
    return cmocka_run_group_tests_name("sessions", tests, hall_make, hall_remove);
}
