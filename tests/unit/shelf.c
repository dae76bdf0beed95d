// Packed files that are kept: what was asked for least lately makes room, and what is being sent
// stays.
#include "web/shelf.h"

#include "test.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// `size` bytes that tell their name.
static const struct packed *put(struct shelf *shelf, const char *name, size_t size) {
    uint8_t *bytes = malloc(size);
    memset(bytes, name[0], size);
    return shelf_put(shelf, name, bytes, size);
}

static void put_away(struct shelf *shelf, const char *name, size_t size) {
    const struct packed *packed = put(shelf, name, size);
    packed_release(&packed);
    assert_null(packed);
}

static bool has(struct shelf *shelf, const char *name) {
    const struct packed *packed = shelf_take(shelf, name);
    bool there = packed;
    if (there)
        assert_int_equal(packed->bytes[packed->size - 1], name[0]);
    packed_release(&packed);
    return there;
}

static void what_was_asked_for_least_lately_makes_room(void **state) {
    (void)state;
    struct shelf *shelf = shelf_create(100);
    put_away(shelf, "a", 40);
    put_away(shelf, "b", 40);
    assert_true(has(shelf, "a"));
    put_away(shelf, "c", 40);
    assert_true(has(shelf, "a"));
    assert_false(has(shelf, "b"));
    assert_true(has(shelf, "c"));
    put_away(shelf, "d", 100);
    assert_false(has(shelf, "a") || has(shelf, "c"));
    assert_true(has(shelf, "d"));
    put_away(shelf, "e", 101); // larger than all of it: nothing goes for it
    assert_false(has(shelf, "e"));
    assert_true(has(shelf, "d"));
    shelf_destroy(&shelf);
    assert_null(shelf);
}

static void of_a_name_there_is_one(void **state) {
    (void)state;
    struct shelf *shelf = shelf_create(100);
    put_away(shelf, "a", 60);
    const struct packed *old = shelf_take(shelf, "a");
    put_away(shelf, "a", 50);
    put_away(shelf, "b", 50); // fits beside it
    const struct packed *new = shelf_take(shelf, "a");
    assert_int_equal(old->size, 60);
    assert_int_equal(new->size, 50);
    assert_true(has(shelf, "b"));
    shelf_destroy(&shelf);
    assert_int_equal(old->bytes[59], 'a'); // who has it goes on sending it
    packed_release(&old);
    packed_release(&new);
}

static void *ask_much(void *user) {
    struct shelf *shelf = user;
    for (int i = 0; i < 3000; i++) {
        char name[2] = {(char)('a' + i * 7 % 5)};
        if (!has(shelf, name))
            put_away(shelf, name, (size_t)(10 + i % 40));
    }
    return NULL;
}

static void many_may_ask_at_once(void **state) {
    (void)state;
    struct shelf *shelf = shelf_create(100);
    pthread_t threads[4];
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, ask_much, shelf), 0);
    for (int i = 0; i < 4; i++)
        pthread_join(threads[i], NULL);
    put_away(shelf, "z", 10);
    assert_true(has(shelf, "z"));
    shelf_destroy(&shelf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_asked_for_least_lately_makes_room),
        cmocka_unit_test(of_a_name_there_is_one),
        cmocka_unit_test(many_may_ask_at_once),
    };
    return cmocka_run_group_tests_name("shelf", tests, NULL, NULL);
}
