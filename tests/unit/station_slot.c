// The slot of a station: who owns a session's id and state, and who waits for what.
#include "sessions/station_slot.h"

#include "base/clock.h"
#include "test.h"

#include <stdatomic.h>
#include <string.h>
#include <time.h>

static struct station_slot slot;
static const struct control_peer peer = {3, 7};

static int open_slot(void **state) {
    (void)state;
    station_slot_init(&slot, 0, "anna");
    return 0;
}

static int close_slot(void **state) {
    (void)state;
    station_slot_fini(&slot);
    return 0;
}

static struct station_status now(void) {
    struct station_status status;
    station_slot_status(&slot, &status);
    return status;
}

static bool join(uint64_t connection) {
    struct station_status status;
    arthron_Hello hello = {.connection = connection};
    return station_slot_join(&slot, peer, &hello, &status);
}

static atomic_bool worker_has_it;

// So slowly that who waits for the session is there first, if it can be.
static void give(void *user) {
    (void)user;
    nanosleep(&(struct timespec){.tv_nsec = 20 * NS_PER_MS}, NULL);
    atomic_store(&worker_has_it, true);
}

static void attach(uint64_t serial) {
    struct session_about about = {.serial = serial};
    memcpy(about.id, now().session_id, sizeof about.id);
    station_slot_attached(&slot, &about, SESSION_WAITING, NULL, NULL, give, NULL);
}

// ---- id and phase -------------------------------------------------------------------------------

static void a_station_that_comes_again_while_its_session_is_opened_gets_that_session(void **state) {
    (void)state;
    assert_true(join(1));
    assert_true(station_slot_claim_needed(&slot, clock_now_ns()));
    struct station_status first = now();
    station_slot_leave(&slot);
    assert_true(join(1));
    assert_false(station_slot_claim_needed(&slot, clock_now_ns()));
    assert_memory_equal(now().session_id, first.session_id, sizeof first.session_id);
    attach(1);
    assert_memory_equal(now().session_id, now().about.id, sizeof first.session_id);
}

static void each_session_has_an_id_of_its_own(void **state) {
    (void)state;
    uint8_t first[16];
    assert_true(station_slot_claim(&slot, NULL));
    memcpy(first, now().session_id, sizeof first);
    assert_false(station_slot_claim(&slot, NULL));
    attach(1);
    assert_false(station_slot_claim(&slot, NULL));
    station_slot_set_state(&slot, 1, SESSION_CLOSED);
    assert_int_equal(now().phase, SLOT_EMPTY);
    assert_true(station_slot_claim(&slot, NULL));
    assert_memory_not_equal(now().session_id, first, sizeof first);
}

static void messages_about_another_session_change_nothing(void **state) {
    (void)state;
    assert_true(station_slot_claim(&slot, NULL));
    station_slot_set_state(&slot, 0, SESSION_CLOSED);
    assert_int_equal(now().phase, SLOT_OPENING);
    attach(2);
    station_slot_set_state(&slot, 1, SESSION_CLOSED);
    assert_int_equal(now().phase, SLOT_ATTACHED);
    station_slot_ending(&slot);
    station_slot_set_state(&slot, 2, SESSION_CLOSED);
    assert_int_equal(now().phase, SLOT_EMPTY);
}

static void a_session_that_its_worker_did_not_stop_goes_on(void **state) {
    (void)state;
    assert_false(station_slot_goes_on(&slot));
    assert_true(station_slot_claim(&slot, NULL));
    attach(2);
    station_slot_ending(&slot);
    assert_true(station_slot_goes_on(&slot));
    assert_true(station_slot_wait_open(&slot, clock_now_ns()));
    assert_int_equal(now().phase, SLOT_ATTACHED);
    station_slot_ending(&slot);
    station_slot_set_state(&slot, 2, SESSION_CLOSED);
    assert_false(station_slot_goes_on(&slot));
    assert_int_equal(now().phase, SLOT_EMPTY);
}

static void an_opening_that_failed_is_tried_again_later(void **state) {
    (void)state;
    int64_t now_ns = clock_now_ns();
    assert_true(join(1));
    assert_true(station_slot_claim_needed(&slot, now_ns));
    station_slot_failed(&slot, now_ns + NS_PER_S);
    assert_false(station_slot_claim_needed(&slot, now_ns));
    assert_true(station_slot_claim_needed(&slot, now_ns + NS_PER_S));
}

// ---- stopped ------------------------------------------------------------------------------------

static void a_link_that_blips_does_not_begin_what_was_stopped(void **state) {
    (void)state;
    assert_true(join(1));
    station_slot_set_stopped(&slot, true);
    station_slot_leave(&slot);
    assert_true(join(1));
    assert_false(station_slot_claim_needed(&slot, clock_now_ns()));
    station_slot_leave(&slot);
    assert_true(join(2)); // the station's program was started again
    assert_true(station_slot_claim_needed(&slot, clock_now_ns()));
}

static void a_station_is_connected_from_one_place(void **state) {
    (void)state;
    assert_true(join(1));
    assert_true(join(1));
    assert_false(join(2));
    station_slot_leave(&slot);
    assert_true(join(2));
}

// ---- waiting ------------------------------------------------------------------------------------

static void *wait_for_session(void *user) {
    bool *had_it = user;
    bool came = station_slot_wait_open(&slot, clock_now_ns() + 60 * NS_PER_S);
    *had_it = came && atomic_load(&worker_has_it);
    return NULL;
}

// Else what the one who waited asks of the session would be there before the session.
static void waiting_for_a_session_ends_when_its_worker_has_it(void **state) {
    (void)state;
    pthread_t thread;
    bool had_it = false;
    atomic_store(&worker_has_it, false);
    assert_true(station_slot_claim(&slot, NULL));
    assert_int_equal(pthread_create(&thread, NULL, wait_for_session, &had_it), 0);
    nanosleep(&(struct timespec){.tv_nsec = 20 * NS_PER_MS}, NULL);
    attach(1);
    pthread_join(thread, NULL);
    assert_true(had_it);
}

static void a_wait_ends_by_its_time_by_its_answer_or_by_a_break_off(void **state) {
    (void)state;
    bool done;
    uint64_t ticket = station_slot_new_ticket(&slot);
    assert_false(station_slot_wait_taken(&slot, ticket, clock_now_ns() + NS_PER_MS, &done));
    station_slot_set_taken(&slot, ticket, true);
    assert_true(station_slot_wait_taken(&slot, ticket, clock_now_ns() + NS_PER_MS, &done));
    assert_true(done);
    ticket = station_slot_new_ticket(&slot);
    station_slot_break_off(&slot);
    assert_false(station_slot_wait_taken(&slot, ticket, clock_now_ns() + 3600 * NS_PER_S, &done));
}

static void a_session_has_ended_once_its_cut_worker_gave_it_back(void **state) {
    (void)state;
    assert_true(station_slot_claim(&slot, NULL));
    attach(7);
    station_slot_set_state(&slot, 7, SESSION_CLOSED);
    assert_false(station_slot_wait_ended(&slot, 7, clock_now_ns() + NS_PER_MS));
    station_slot_set_ended(&slot, 7);
    assert_true(station_slot_wait_ended(&slot, 7, clock_now_ns() + NS_PER_MS));
    assert_false(station_slot_wait_ended(&slot, 8, clock_now_ns() + NS_PER_MS));
}

static void an_undo_is_answered_by_all_of_its_jobs(void **state) {
    (void)state;
    struct undo_answer undone, one = {JOB_DONE, 2, 10};
    uint64_t ticket, other;
    assert_true(station_slot_claim(&slot, NULL));
    attach(5);
    assert_true(station_slot_begin_undo(&slot, &ticket));
    assert_false(station_slot_begin_undo(&slot, &other));
    station_slot_add_undone(&slot, ticket, &one, true);
    station_slot_add_undone(&slot, ticket, &one, false);
    assert_true(station_slot_end_undo(&slot, clock_now_ns() + NS_PER_MS, &undone));
    assert_int_equal(undone.cuts, 4);
    assert_true(station_slot_begin_undo(&slot, &ticket));
}

static void an_answer_to_an_undo_that_was_given_up_is_no_other_ones(void **state) {
    (void)state;
    struct undo_answer undone, late = {JOB_DONE, 7, 10}, own = {JOB_DONE, 2, 10};
    uint64_t given_up, ticket;
    assert_true(station_slot_claim(&slot, NULL));
    attach(5);
    assert_true(station_slot_begin_undo(&slot, &given_up));
    station_slot_cancel_undo(&slot);
    station_slot_add_undone(&slot, given_up, &late, false);
    assert_true(station_slot_begin_undo(&slot, &ticket));
    station_slot_add_undone(&slot, given_up, &late, false);
    assert_false(station_slot_end_undo(&slot, clock_now_ns(), &undone));
    station_slot_add_undone(&slot, ticket, &own, false);
    assert_true(station_slot_begin_undo(&slot, &ticket));
    station_slot_add_undone(&slot, ticket, &own, false);
    assert_true(station_slot_end_undo(&slot, clock_now_ns() + NS_PER_MS, &undone));
    assert_int_equal(undone.cuts, 2);
}

static void an_undo_ends_unanswered_with_its_session(void **state) {
    (void)state;
    struct undo_answer undone;
    uint64_t ticket;
    assert_true(station_slot_claim(&slot, NULL));
    attach(5);
    assert_true(station_slot_begin_undo(&slot, &ticket));
    station_slot_set_state(&slot, 5, SESSION_CLOSED);
    assert_false(station_slot_end_undo(&slot, clock_now_ns() + 3600 * NS_PER_S, &undone));
    assert_true(station_slot_claim(&slot, NULL));
    attach(6);
    assert_true(station_slot_begin_undo(&slot, &ticket));
}

int main(void) {
#define SLOT_TEST(test) cmocka_unit_test_setup_teardown(test, open_slot, close_slot)
    const struct CMUnitTest tests[] = {
        SLOT_TEST(a_station_that_comes_again_while_its_session_is_opened_gets_that_session),
        SLOT_TEST(each_session_has_an_id_of_its_own),
        SLOT_TEST(messages_about_another_session_change_nothing),
        SLOT_TEST(a_session_that_its_worker_did_not_stop_goes_on),
        SLOT_TEST(an_opening_that_failed_is_tried_again_later),
        SLOT_TEST(a_link_that_blips_does_not_begin_what_was_stopped),
        SLOT_TEST(a_station_is_connected_from_one_place),
        SLOT_TEST(waiting_for_a_session_ends_when_its_worker_has_it),
        SLOT_TEST(a_wait_ends_by_its_time_by_its_answer_or_by_a_break_off),
        SLOT_TEST(a_session_has_ended_once_its_cut_worker_gave_it_back),
        SLOT_TEST(an_undo_is_answered_by_all_of_its_jobs),
        SLOT_TEST(an_answer_to_an_undo_that_was_given_up_is_no_other_ones),
        SLOT_TEST(an_undo_ends_unanswered_with_its_session),
    };
    return cmocka_run_group_tests_name("slot", tests, NULL, NULL);
}
