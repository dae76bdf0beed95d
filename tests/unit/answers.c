// The answers to a page's commands, in the order of the commands, wherever they come from.
#include "live/answers.h"

#include "live/viewer.h"
#include "test.h"

#include <stdlib.h>

#define HERE 0
#define B 1
#define C 2

static struct parcel *parcel(uint8_t what) {
    struct parcel *p = calloc(1, sizeof *p + 1);
    p->size = 1;
    p->bytes[0] = what;
    return p;
}

static void assert_next(struct answers *answers, uint8_t what) {
    assert_true(answers_are_next(answers));
    struct parcel *next = answers_next(answers);
    assert_int_equal(next->bytes[0], what);
    free(next);
}

static void answers_come_in_the_order_of_the_commands(void **state) {
    (void)state;
    struct answers answers = {0};
    for (int round = 0; round < 5; round++) { // so that the places are used again
        answers_expect(&answers, 1u << B);
        answers_expect(&answers, 1u << HERE);
        answers_expect(&answers, 1u << B);
        answers_take(&answers, HERE, parcel(2));
        assert_false(answers_are_next(&answers));
        answers_take(&answers, B, parcel(1));
        assert_next(&answers, 1);
        assert_next(&answers, 2);
        assert_false(answers_are_next(&answers));
        assert_true(answers_wait_for(&answers, B));
        answers_take(&answers, B, parcel(3));
        assert_next(&answers, 3);
        assert_int_equal(answers.count, 0);
        assert_false(answers_wait_for(&answers, B));
    }
}

static void an_answer_that_nobody_waits_for_is_dropped(void **state) {
    (void)state;
    struct answers answers = {0};
    answers_take(&answers, B, parcel(1));
    answers_expect(&answers, 1u << HERE);
    answers_take(&answers, B, parcel(1));
    assert_false(answers_are_next(&answers));
    answers_clear(&answers);
    assert_int_equal(answers.count, 0);
}

static void a_server_that_is_lost_answers_with_a_refusal(void **state) {
    (void)state;
    struct answers answers = {0};
    struct parcel *refusal = parcel(9);
    answers_expect(&answers, 1u << B);
    answers_expect(&answers, 1u << C);
    answers_expect(&answers, 1u << B);
    answers_lost(&answers, B, refusal);
    assert_next(&answers, 9);
    assert_false(answers_are_next(&answers));
    answers_take(&answers, C, parcel(4));
    assert_next(&answers, 4);
    assert_next(&answers, 9);
    free(refusal);
}

// Without what a lost one would have told.
static void a_list_waits_for_all_that_answer(void **state) {
    (void)state;
    struct answers answers = {0};
    struct parcel *refusal = parcel(9);
    answers_expect(&answers, 1u << HERE | 1u << B | 1u << C);
    answers_take(&answers, C, parcel(3)); // is no list, so nothing of it is taken
    answers_lost(&answers, B, refusal);
    assert_false(answers_are_next(&answers));
    answers_take(&answers, HERE, parcel(1));
    assert_next(&answers, 1);
    free(refusal);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(answers_come_in_the_order_of_the_commands),
        cmocka_unit_test(an_answer_that_nobody_waits_for_is_dropped),
        cmocka_unit_test(a_server_that_is_lost_answers_with_a_refusal),
        cmocka_unit_test(a_list_waits_for_all_that_answer),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
