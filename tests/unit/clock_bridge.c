// Frames of a station whose clock is stepped while they come.
#include "runtime/clock_bridge.h"

#include "base/clock.h"
#include "random.h"
#include "test.h"

#include <stdlib.h>

#define PERIOD_NS (5 * NS_PER_MS)
#define OFFSET_NS (1234 * NS_PER_S) // server = station + offset
#define WAY_NS (2 * NS_PER_MS)

// Frames of 2 s, the clock stepped after the first; measured anew after the second.
static void frames_go_on_over_a_step(void **state) {
    (void)state;
    static const int64_t steps_ms[] = {-2000, -150, -60, 150, 2000, 100000};
    for (unsigned s = 0; s < sizeof steps_ms / sizeof *steps_ms; s++) {
        struct clock_bridge bridge = {0};
        struct random random = {s + 1};
        int64_t step_ns = steps_ms[s] * NS_PER_MS, told_ns = 0, before_ns = 0;
        int told = 0;
        for (int64_t closed_ns = NS_PER_S; closed_ns < 3 * NS_PER_S; closed_ns += PERIOD_NS) {
            int64_t off_ns = closed_ns < 2 * NS_PER_S ? 0 : step_ns;
            int64_t time_ns = 500 * NS_PER_S + closed_ns + off_ns, now_step_ns;
            int64_t received_ns = 500 * NS_PER_S + OFFSET_NS + closed_ns + WAY_NS +
                                  (int64_t)random_between(&random, 0, 1e6);
            int64_t measured_ns = OFFSET_NS - (closed_ns < 5 * NS_PER_S / 2 ? 0 : off_ns);
            int64_t offset_ns =
                clock_bridge_offset(&bridge, time_ns, received_ns, measured_ns, &now_step_ns);
            told += now_step_ns != 0;
            told_ns += now_step_ns;
            int64_t on_ours_ns = time_ns + offset_ns;
            assert_true(before_ns == 0 || on_ours_ns > before_ns);
            assert_true(llabs(on_ours_ns - received_ns) <= WAY_NS + 2 * NS_PER_MS);
            before_ns = on_ours_ns;
        }
        assert_int_equal(told, 1);
        assert_true(llabs(told_ns - step_ns) < 2 * NS_PER_MS);
    }
}

static void jitter_and_stalls_are_no_step(void **state) {
    (void)state;
    struct clock_bridge bridge = {0};
    struct random random = {7};
    for (int64_t closed_ns = NS_PER_S; closed_ns < 20 * NS_PER_S; closed_ns += PERIOD_NS) {
        int64_t way_ns = (int64_t)random_between(&random, 0, 300e6), step_ns;
        if (closed_ns > 10 * NS_PER_S && closed_ns < 12 * NS_PER_S)
            way_ns = 12 * NS_PER_S - closed_ns; // all at once
        assert_int_equal(clock_bridge_offset(&bridge, closed_ns, closed_ns + OFFSET_NS + way_ns,
                                             OFFSET_NS, &step_ns),
                         OFFSET_NS);
        assert_int_equal(step_ns, 0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_go_on_over_a_step),
        cmocka_unit_test(jitter_and_stalls_are_no_step),
    };
    return cmocka_run_group_tests_name("clock_bridge", tests, NULL, NULL);
}
