// The newest of a stream, from one thread to another: whole, in order, and never without the last.
#include "base/newest.h"

#include "test.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#define WORDS 64
#define LAST 200000

struct item {
    uint64_t words[WORDS]; // all the same
};

static void the_newest_value_is_taken_once(void **state) {
    (void)state;
    struct newest *newest = newest_create(sizeof(int));
    int item = 0;
    assert_false(newest_take(newest, &item));
    assert_true(newest_put(newest, &(int){1}));
    assert_false(newest_put(newest, &(int){2}));
    assert_false(newest_put(newest, &(int){3}));
    assert_true(newest_take(newest, &item));
    assert_int_equal(item, 3);
    assert_false(newest_take(newest, &item));
    assert_true(newest_put(newest, &(int){4}));
    assert_true(newest_take(newest, &item));
    assert_int_equal(item, 4);
    newest_destroy(&newest);
    assert_null(newest);
}

static void *put_all(void *argument) {
    struct item item;
    for (uint64_t n = 1; n <= LAST; n++) {
        for (int i = 0; i < WORDS; i++)
            item.words[i] = n;
        newest_put(argument, &item);
    }
    return NULL;
}

static void another_thread_gets_whole_items_in_order_and_the_last(void **state) {
    (void)state;
    struct newest *newest = newest_create(sizeof(struct item));
    pthread_t thread;
    struct item item = {0};
    assert_int_equal(pthread_create(&thread, NULL, put_all, newest), 0);
    for (uint64_t seen = 0; seen < LAST;) {
        if (!newest_take(newest, &item))
            continue;
        assert_true(item.words[0] > seen);
        seen = item.words[0];
        for (int i = 1; i < WORDS; i++)
            assert_int_equal(item.words[i], seen);
    }
    pthread_join(thread, NULL);
    assert_false(newest_take(newest, &item));
    newest_destroy(&newest);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_newest_value_is_taken_once),
        cmocka_unit_test(another_thread_gets_whole_items_in_order_and_the_last),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
