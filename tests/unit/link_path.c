// Which way frames travel.
#include "base/clock.h"
#include "link/path.h"
#include "test.h"

static void a_path_needs_three_answers_in_a_row(void **state) {
    (void)state;
    struct path path = {0};
    int64_t now_ns = NS_PER_S;
    for (int round = 0; round < 2;
         round++) { // two answers, then a trial without one: from the start
        for (int i = 0; i < 2; i++, now_ns += NS_PER_S) {
            assert_true(path_next(&path, now_ns).datagram);
            assert_false(path_next(&path, now_ns).datagram);
            path_answered(&path, now_ns, now_ns);
            path_answered(&path, now_ns, now_ns); // late ones do not count twice
        }
        assert_true(path_next(&path, now_ns).datagram);
        now_ns += NS_PER_S;
    }
    assert_false(path.datagrams);
    for (int i = 0; i < 3; i++, now_ns += NS_PER_S) {
        struct frame_route route = path_next(&path, now_ns);
        assert_true(route.control && route.datagram);
        path_answered(&path, now_ns, now_ns);
    }
    struct frame_route route = path_next(&path, now_ns);
    assert_true(!route.control && route.datagram);
}

static void a_path_bears_a_pause_but_not_silence(void **state) {
    (void)state;
    struct path path = {.datagrams = true};
    int64_t now_ns = NS_PER_S;
    assert_false(path_next(&path, now_ns).control);
    path_answered(&path, now_ns, now_ns + 1);
    now_ns += 60 * NS_PER_S; // nothing was sent, so nothing was missed
    assert_false(path_next(&path, now_ns).control);
    assert_false(path_next(&path, now_ns + 300 * NS_PER_MS).control);
    assert_true(path_next(&path, now_ns + 301 * NS_PER_MS).control);
}

// It takes the datagrams' way for silent only when nothing comes for longer than answers take.
static void a_long_way_is_no_silence(void **state) {
    (void)state;
    struct path path = {.datagrams = true};
    int64_t way_ns = 600 * NS_PER_MS, now_ns = NS_PER_S;
    path_answered(&path, now_ns - way_ns, now_ns);
    assert_false(path_next(&path, now_ns).control);
    assert_false(path_next(&path, now_ns + 2 * way_ns + 300 * NS_PER_MS).control);
    assert_true(path_next(&path, now_ns + 2 * way_ns + 301 * NS_PER_MS).control);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_path_needs_three_answers_in_a_row),
        cmocka_unit_test(a_path_bears_a_pause_but_not_silence),
        cmocka_unit_test(a_long_way_is_no_silence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
