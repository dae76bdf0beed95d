// When a worker looks at its stations, against a list of times that is searched as a whole.
#include "runtime/looks.h"

#include "base/clock.h"
#include "random.h"
#include "test.h"

#include <string.h>

#define PLACES 50
#define NEVER INT64_MAX

static int64_t wanted_ns[PLACES];

// The latest time that a look may have been asked for and come by now.
static bool is_due(int place, int64_t now_ns) {
    return wanted_ns[place] + LOOKS_TURN_NS <= now_ns;
}

static void ask(struct looks *looks, int place, int64_t now_ns, int64_t when_ns) {
    int64_t farthest_ns = now_ns + LOOKS_FARTHEST_NS;
    when_ns = when_ns < now_ns ? now_ns : when_ns;
    int64_t by_ns = when_ns < farthest_ns ? when_ns : farthest_ns;
    looks_by(looks, place, when_ns);
    if (by_ns < wanted_ns[place])
        wanted_ns[place] = by_ns;
}

static void each_place_comes_when_it_is_due_and_once(void **state) {
    (void)state;
    struct random random = {7};
    struct looks *looks = looks_create(PLACES);
    int64_t now_ns = 1000 * NS_PER_S;
    for (int i = 0; i < PLACES; i++)
        wanted_ns[i] = NEVER;
    assert_int_equal(looks_take(looks, now_ns), -1);
    for (int round = 0; round < 20000; round++) {
        int place = (int)(random_bits(&random) % PLACES);
        ask(looks, place, now_ns,
            now_ns + (int64_t)(random_bits(&random) % 4000 - 500) * NS_PER_MS);
        now_ns += (int64_t)(random_bits(&random) % (round % 100 ? 20 : 5000)) * NS_PER_MS;
        while ((place = looks_take(looks, now_ns)) >= 0) {
            assert_true(wanted_ns[place] <= now_ns + LOOKS_TURN_NS); // not too early
            wanted_ns[place] = NEVER;
        }
        for (int i = 0; i < PLACES; i++)
            assert_false(wanted_ns[i] != NEVER && is_due(i, now_ns - LOOKS_TURN_NS));
    }
    looks_destroy(&looks);
}

static void the_time_of_the_next_look_is_told(void **state) {
    (void)state;
    struct looks *looks = looks_create(2);
    int64_t now_ns = 1000 * NS_PER_S, until_ns = now_ns + 100 * NS_PER_MS;
    looks_take(looks, now_ns);
    assert_int_equal(looks_next_ns(looks, until_ns), until_ns);
    looks_by(looks, 0, now_ns + 500 * NS_PER_MS);
    assert_int_equal(looks_next_ns(looks, until_ns), until_ns);
    looks_by(looks, 1, now_ns + 30 * NS_PER_MS);
    int64_t next_ns = looks_next_ns(looks, until_ns);
    assert_in_range(next_ns, now_ns + 30 * NS_PER_MS, now_ns + 30 * NS_PER_MS + LOOKS_TURN_NS);
    assert_int_equal(looks_take(looks, next_ns - LOOKS_TURN_NS), -1);
    assert_int_equal(looks_take(looks, next_ns), 1);
    looks_destroy(&looks);
}

static void an_earlier_look_stays(void **state) {
    (void)state;
    struct looks *looks = looks_create(1);
    int64_t now_ns = 1000 * NS_PER_S;
    looks_take(looks, now_ns);
    looks_by(looks, 0, now_ns + 10 * NS_PER_MS);
    looks_by(looks, 0, now_ns + 500 * NS_PER_MS);
    assert_int_equal(looks_take(looks, now_ns + 5 * NS_PER_MS), -1);
    assert_int_equal(looks_take(looks, now_ns + 12 * NS_PER_MS), 0);
    assert_int_equal(looks_take(looks, now_ns + 10 * NS_PER_S), -1);
    looks_destroy(&looks);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_place_comes_when_it_is_due_and_once),
        cmocka_unit_test(an_earlier_look_stays),
        cmocka_unit_test(the_time_of_the_next_look_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
