// Which server a station tries next.
#include "link/servers.h"

#include "base/clock.h"
#include "test.h"

#include <string.h>

enum { A, B, C };

static const struct server_address list[] = {{"a", 1}, {"b", 2}, {"c", 3}};
static const struct server_address named = {"d", 4}, further = {"e", 5};
static const uint8_t knee[16] = {1}, other_knee[16] = {2};

static struct servers some(int count) {
    struct servers s;
    servers_init(&s, list, count);
    return s;
}

static void assert_present(const struct servers *s, const struct server_address *expected) {
    assert_string_equal(servers_present(s)->host, expected->host);
    assert_int_equal(servers_present(s)->port, expected->port);
}

// A connection that lasts.
static int64_t serve(struct servers *s, int64_t now_ns) {
    assert_true(servers_welcomed(s, knee, 0, now_ns));
    return now_ns + 60 * NS_PER_S;
}

// ---- text ---------------------------------------------------------------------------------------

static void addresses_are_read_and_written(void **state) {
    (void)state;
    struct server_address out[SERVERS_MAX];
    char text[SERVER_TEXT_SIZE];
    assert_int_equal(servers_parse("a.example.org:4810 ,[fd00::2]:1,\t10.0.0.1:65535 ", out), 3);
    assert_string_equal(out[0].host, "a.example.org");
    assert_string_equal(out[1].host, "fd00::2");
    assert_int_equal(out[1].port, 1);
    server_write(&out[1], text);
    assert_string_equal(text, "[fd00::2]:1");
    server_write(&out[2], text);
    assert_string_equal(text, "10.0.0.1:65535");
    assert_int_equal(servers_parse("a:1,a:1,a:1,a:1,a:1,a:1,a:1,a:1", out), SERVERS_MAX);
}

static void what_is_no_list_of_addresses_is_none(void **state) {
    (void)state;
    struct server_address out[SERVERS_MAX];
    const char *const bad[] = {"",        "a",    ":1",   "a:0",
                               "a:65536", "a:1,", ",a:1", "a:1,,b:2",
                               "a:1 b:2", "[]:1", "a:x",  "a:1,a:1,a:1,a:1,a:1,a:1,a:1,a:1,a:1"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_int_equal(servers_parse(bad[i], out), 0);
}

// ---- one ----------------------------------------------------------------------------------------

static void one_alone_is_tried_again_and_again(void **state) {
    (void)state;
    struct servers s = some(1);
    assert_false(servers_has_other(&s));
    for (int i = 0; i < 5; i++) {
        assert_int_equal(servers_lost(&s, i % 2, i), SERVERS_BACK_OFF);
        assert_present(&s, &list[A]);
    }
    int64_t now_ns = serve(&s, 1);
    assert_int_equal(servers_lost(&s, false, now_ns), SERVERS_BACK_OFF);
}

static void one_alone_that_wants_time_gets_it(void **state) {
    (void)state;
    struct servers s = some(1);
    assert_int_equal(servers_ask_again(&s, 700, 0), 700);
    assert_int_equal(servers_ask_again(&s, 1, 0), 50);
    assert_int_equal(servers_ask_again(&s, UINT32_MAX, 0), 10000);
    assert_present(&s, &list[A]);
}

// ---- several ------------------------------------------------------------------------------------

static void all_are_tried_before_it_waits(void **state) {
    (void)state;
    struct servers s = some(3);
    assert_true(servers_has_other(&s));
    for (int round = 0; round < 3; round++) {
        assert_present(&s, &list[A]);
        assert_int_equal(servers_lost(&s, false, 0), 0);
        assert_present(&s, &list[B]);
        assert_int_equal(servers_lost(&s, true, 0), 0);
        assert_present(&s, &list[C]);
        assert_int_equal(servers_lost(&s, false, 0), SERVERS_BACK_OFF);
    }
}

static void after_a_loss_the_next_one_is_tried_at_once(void **state) {
    (void)state;
    struct servers s = some(3);
    assert_int_equal(servers_lost(&s, true, 0), 0);
    int64_t now_ns = serve(&s, 1); // at B
    assert_int_equal(servers_lost(&s, true, now_ns), 0);
    assert_present(&s, &list[C]);
    assert_int_equal(servers_lost(&s, true, now_ns), 0);
    assert_present(&s, &list[A]);
    assert_int_equal(servers_lost(&s, true, now_ns), SERVERS_BACK_OFF);
    assert_present(&s, &list[B]); // the last good one first
}

static void connections_that_end_at_once_do_not_go_round_without_a_wait(void **state) {
    (void)state;
    struct servers s = some(2);
    int waits = 0;
    for (int i = 0; i < 20; i++) {
        assert_true(servers_welcomed(&s, knee, 0, i + 1));
        waits += servers_lost(&s, false, i + 2) == SERVERS_BACK_OFF;
    }
    assert_int_equal(waits, 10);
}

static void a_server_that_wants_time_is_asked_some_times_and_then_others(void **state) {
    (void)state;
    struct servers s = some(2);
    for (int i = 0; i < SERVERS_ASKED_MAX; i++) {
        assert_int_equal(servers_ask_again(&s, 300, 0), 300);
        assert_present(&s, &list[A]);
    }
    assert_int_equal(servers_ask_again(&s, 300, 0), 0);
    assert_present(&s, &list[B]);
}

// ---- elsewhere ----------------------------------------------------------------------------------

static void it_goes_where_it_is_sent(void **state) {
    (void)state;
    struct servers s = some(2);
    assert_int_equal(servers_elsewhere(&s, &list[B], 0), 0);
    assert_present(&s, &list[B]);
    int64_t now_ns = serve(&s, 1);
    assert_int_equal(servers_elsewhere(&s, &named, now_ns), 0);
    assert_present(&s, &named);
    now_ns = serve(&s, now_ns);
    assert_int_equal(servers_lost(&s, true, now_ns), 0); // to the list
    assert_present(&s, &list[B]);
}

static void one_alone_may_send_it_elsewhere_too(void **state) {
    (void)state;
    struct servers s = some(1);
    assert_int_equal(servers_elsewhere(&s, &named, 0), 0);
    assert_present(&s, &named);
    assert_true(servers_has_other(&s));
    assert_true(servers_lost(&s, true, 0) > 0);
    assert_present(&s, &list[A]);
}

static void servers_that_send_it_round_are_followed_four_times(void **state) {
    (void)state;
    struct servers s = some(2);
    int followed = 0, next = 0;
    const struct server_address *const ways[] = {&named, &further};
    for (int i = 0; !(next = servers_elsewhere(&s, ways[i % 2], 0)); i++) {
        if (servers_present(&s)->port == list[B].port)
            break;
        followed++;
    }
    assert_int_equal(followed, SERVERS_FOLLOWED_MAX);
    assert_present(&s, &list[B]); // back to the list
    assert_int_equal(next, 0);
}

static void what_is_no_address_is_not_followed(void **state) {
    (void)state;
    struct servers s = some(2);
    assert_int_equal(servers_elsewhere(&s, NULL, 0), 0);
    assert_present(&s, &list[B]);
    assert_int_equal(servers_elsewhere(&s, NULL, 0), SERVERS_BACK_OFF);
}

// A is stopped; until its lease ends, B sends the station back to it.
static void a_silent_owner_is_not_waited_for_again(void **state) {
    (void)state;
    struct servers s = some(2);
    int64_t now_ns = serve(&s, 1);
    assert_int_equal(servers_lost(&s, true, now_ns), 0);
    for (int i = 0; i < SERVERS_ASKED_MAX; i++) {
        assert_present(&s, &list[B]);
        assert_int_equal(servers_elsewhere(&s, &list[A], now_ns), 500);
    }
    assert_int_equal(servers_elsewhere(&s, &list[A], now_ns), SERVERS_BACK_OFF);
    assert_present(&s, &list[B]);
    assert_int_equal(servers_elsewhere(&s, &list[A], now_ns), 0); // it may be back
    assert_present(&s, &list[A]);
}

// A was killed and comes back: both are looked at in turn, without haste.
static void an_owner_that_refuses_connections_is_tried_between(void **state) {
    (void)state;
    struct servers s = some(2);
    int64_t now_ns = serve(&s, 1);
    assert_int_equal(servers_lost(&s, false, now_ns), 0);
    for (int i = 0; i < 4; i++) {
        assert_present(&s, &list[B]);
        assert_int_equal(servers_elsewhere(&s, &list[A], now_ns), 0);
        assert_present(&s, &list[A]);
        assert_int_equal(servers_lost(&s, false, now_ns), 500);
    }
    assert_present(&s, &list[B]);
}

static void a_third_one_is_asked_before_the_second_one_again(void **state) {
    (void)state;
    struct servers s = some(3);
    int64_t now_ns = serve(&s, 1);
    assert_int_equal(servers_lost(&s, true, now_ns), 0);
    assert_present(&s, &list[B]);
    assert_int_equal(servers_elsewhere(&s, &list[A], now_ns), 0);
    assert_present(&s, &list[C]);
}

static void a_server_that_names_itself_is_asked_again_later(void **state) {
    (void)state;
    struct servers s = some(1);
    assert_int_equal(servers_elsewhere(&s, &list[A], 0), 500);
    assert_present(&s, &list[A]);
}

// ---- tokens -------------------------------------------------------------------------------------

static void a_lower_token_of_the_same_session_is_out_of_date(void **state) {
    (void)state;
    struct servers s = some(2);
    assert_true(servers_welcomed(&s, knee, 5, 1));
    assert_true(servers_welcomed(&s, knee, 7, 1));
    assert_false(servers_welcomed(&s, knee, 6, 1));
    assert_true(servers_welcomed(&s, knee, 7, 1));
    assert_true(servers_welcomed(&s, knee, 0, 1)); // a server that stands alone again
    assert_false(servers_welcomed(&s, knee, 6, 1));
}

static void tokens_of_a_new_session_begin_anew(void **state) {
    (void)state;
    struct servers s = some(2);
    assert_true(servers_welcomed(&s, knee, 7, 1));
    assert_true(servers_welcomed(&s, other_knee, 2, 1));
    assert_false(servers_welcomed(&s, other_knee, 1, 1));
    assert_false(servers_welcomed(&s, knee, 6, 1)); // of the one before, too
}

static void the_newest_sessions_are_remembered(void **state) {
    (void)state;
    struct servers s = some(2);
    for (uint8_t i = 0; i <= SERVERS_SESSIONS; i++)
        assert_true(servers_welcomed(&s, (uint8_t[16]){i}, 7, 1));
    assert_true(servers_welcomed(&s, (uint8_t[16]){0}, 1, 1));
    for (uint8_t i = 2; i <= SERVERS_SESSIONS; i++)
        assert_false(servers_welcomed(&s, (uint8_t[16]){i}, 6, 1));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(addresses_are_read_and_written),
        cmocka_unit_test(what_is_no_list_of_addresses_is_none),
        cmocka_unit_test(one_alone_is_tried_again_and_again),
        cmocka_unit_test(one_alone_that_wants_time_gets_it),
        cmocka_unit_test(all_are_tried_before_it_waits),
        cmocka_unit_test(after_a_loss_the_next_one_is_tried_at_once),
        cmocka_unit_test(connections_that_end_at_once_do_not_go_round_without_a_wait),
        cmocka_unit_test(a_server_that_wants_time_is_asked_some_times_and_then_others),
        cmocka_unit_test(it_goes_where_it_is_sent),
        cmocka_unit_test(one_alone_may_send_it_elsewhere_too),
        cmocka_unit_test(servers_that_send_it_round_are_followed_four_times),
        cmocka_unit_test(what_is_no_address_is_not_followed),
        cmocka_unit_test(a_silent_owner_is_not_waited_for_again),
        cmocka_unit_test(an_owner_that_refuses_connections_is_tried_between),
        cmocka_unit_test(a_third_one_is_asked_before_the_second_one_again),
        cmocka_unit_test(a_server_that_names_itself_is_asked_again_later),
        cmocka_unit_test(a_lower_token_of_the_same_session_is_out_of_date),
        cmocka_unit_test(tokens_of_a_new_session_begin_anew),
        cmocka_unit_test(the_newest_sessions_are_remembered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
