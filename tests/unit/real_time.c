#include "runtime/real_time.h"

#include "base/clock.h"
#include "test.h"

#include <sched.h>

#define ROUND_NS (10 * NS_PER_MS)

static int policy(void) {
    return sched_getscheduler(0) & ~SCHED_RESET_ON_FORK;
}

// A second of rounds that wait for a share of their time.
static void pass(struct real_time *r, int64_t *now_ns, double waits) {
    for (int i = 0; i < 100; i++) {
        int64_t begin_ns = *now_ns + (int64_t)((1 - waits) * ROUND_NS);
        *now_ns += ROUND_NS;
        real_time_waited(r, begin_ns, *now_ns);
    }
}

// Where the system gives no priority it stays as it is.
static void who_is_busy_gives_the_priority_back(void **state) {
    (void)state;
    int64_t now_ns = 5 * NS_PER_S;
    struct real_time r;
    int usual = policy();
    int taken = real_time_begin(&r, now_ns) ? SCHED_RR : usual;
    assert_int_equal(policy(), taken);
    pass(&r, &now_ns, 0.7);
    assert_int_equal(policy(), taken);
    pass(&r, &now_ns, 0.1);
    assert_int_equal(policy(), usual);
    pass(&r, &now_ns, 0.4); // not idle enough yet
    assert_int_equal(policy(), usual);
    pass(&r, &now_ns, 0.6);
    assert_int_equal(policy(), taken);
    pass(&r, &now_ns, 0.3); // less than that, but not all of it
    assert_int_equal(policy(), taken);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(who_is_busy_gives_the_priority_back)};
    return cmocka_run_group_tests_name("real_time", tests, NULL, NULL);
}
