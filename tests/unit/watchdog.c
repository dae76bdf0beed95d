// When a thread hangs, and when it only waits for its turn.
#include "runtime/watchdog.h"

#include "base/clock.h"
#include "test.h"

#define PATIENCE_NS (1500 * NS_PER_MS)

// Looks at a thread that makes no progress; returns after how many ms it counts as hanging, at most
// 10 s.
static int64_t hangs_after_ms(double computes, bool waits_for_processor, int64_t look_ns) {
    struct watch watch = {.patience_ns = PATIENCE_NS};
    for (int64_t passed_ns = 0; passed_ns <= 10 * NS_PER_S; passed_ns += look_ns) {
        struct watch_look look = {.now_ns = NS_PER_S + passed_ns,
                                  .beats = 42,
                                  .computed_ns = (int64_t)(computes * (double)passed_ns),
                                  .waits_for_processor = waits_for_processor};
        if (watch_judge(&watch, &look))
            return passed_ns / NS_PER_MS;
    }
    return -1;
}

static void a_blocked_thread_hangs_within_its_patience_and_a_look(void **state) {
    (void)state;
    int64_t ms = hangs_after_ms(0, false, WATCHDOG_LOOK_NS);
    assert_true(ms >= 1500 && ms <= 1700);
}

static void a_thread_that_computes_on_and_on_hangs(void **state) {
    (void)state;
    int64_t ms = hangs_after_ms(1, true, WATCHDOG_LOOK_NS);
    assert_true(ms >= 1500 && ms <= 1700);
}

static void a_thread_that_gets_no_processor_does_not_hang(void **state) {
    (void)state;
    assert_int_equal(hangs_after_ms(0.1, true, WATCHDOG_LOOK_NS), -1);
}

static void a_machine_without_time_for_the_watchdog_makes_no_thread_hang(void **state) {
    (void)state;
    assert_int_equal(hangs_after_ms(0, false, WATCHDOG_LOOK_NS * 3 / 2), -1);
}

static void progress_begins_its_patience_anew(void **state) {
    (void)state;
    struct watch watch = {.patience_ns = PATIENCE_NS};
    for (int i = 0; i < 100; i++) {
        struct watch_look look = {.now_ns = NS_PER_S + i * WATCHDOG_LOOK_NS,
                                  .beats = (uint64_t)i / 7,
                                  .computed_ns = i * WATCHDOG_LOOK_NS};
        assert_false(watch_judge(&watch, &look));
    }
}

// The whole process was stopped for a minute, and its clock went on.
static void a_pause_of_the_whole_process_is_no_block(void **state) {
    (void)state;
    struct watch watch = {.patience_ns = PATIENCE_NS};
    struct watch_look look = {.now_ns = NS_PER_S, .beats = 42};
    assert_false(watch_judge(&watch, &look));
    look.now_ns += 60 * NS_PER_S;
    assert_false(watch_judge(&watch, &look));
    look.now_ns += WATCHDOG_LOOK_NS;
    assert_false(watch_judge(&watch, &look));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_blocked_thread_hangs_within_its_patience_and_a_look),
        cmocka_unit_test(a_thread_that_computes_on_and_on_hangs),
        cmocka_unit_test(a_thread_that_gets_no_processor_does_not_hang),
        cmocka_unit_test(a_machine_without_time_for_the_watchdog_makes_no_thread_hang),
        cmocka_unit_test(progress_begins_its_patience_anew),
        cmocka_unit_test(a_pause_of_the_whole_process_is_no_block),
    };
    return cmocka_run_group_tests_name("watchdog", tests, NULL, NULL);
}
