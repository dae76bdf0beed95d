#include "runtime/real_time.h"

#include "base/clock.h"
#include "test.h"

#include <sched.h>
#include <sys/resource.h>

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
static void without_the_limit_there_is_no_priority(void **state) {
    (void)state;
    struct rlimit limit = {REAL_TIME_PRIORITY - 1, REAL_TIME_PRIORITY};
    struct real_time r;
    int usual = policy();
    setrlimit(RLIMIT_RTPRIO, &limit);
    assert_false(real_time_begin(&r, NS_PER_S));
    assert_int_equal(policy(), usual);
}

static void who_is_busy_gives_the_priority_back(void **state) {
    (void)state;
    int64_t now_ns = 5 * NS_PER_S;
    struct real_time r;
    int usual = policy();
    struct rlimit limit = {REAL_TIME_PRIORITY, REAL_TIME_PRIORITY};
    setrlimit(RLIMIT_RTPRIO, &limit);
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
    const struct CMUnitTest tests[] = {cmocka_unit_test(without_the_limit_there_is_no_priority),
                                       cmocka_unit_test(who_is_busy_gives_the_priority_back)};
    return cmocka_run_group_tests_name("real_time", tests, NULL, NULL);
}
