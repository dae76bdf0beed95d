// Packed files that are kept: what was asked for least lately makes room, and what is being sent
// stays.
#include "web/gzip_cache.h"

#include "test.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// `size` bytes that tell their name.
static const struct gzip_file *put(struct gzip_cache *cache, const char *name, size_t size) {
    uint8_t *bytes = malloc(size);
    memset(bytes, name[0], size);
    return gzip_cache_put(cache, name, bytes, size);
}

static void put_away(struct gzip_cache *cache, const char *name, size_t size) {
    const struct gzip_file *packed = put(cache, name, size);
    gzip_file_release(&packed);
    assert_null(packed);
}

static bool has(struct gzip_cache *cache, const char *name) {
    const struct gzip_file *packed = gzip_cache_take(cache, name);
    bool there = packed;
    if (there)
        assert_int_equal(packed->bytes[packed->size - 1], name[0]);
    gzip_file_release(&packed);
    return there;
}

static void the_least_recently_used_file_makes_room(void **state) {
    (void)state;
    struct gzip_cache *cache = gzip_cache_create(100);
    put_away(cache, "a", 40);
    put_away(cache, "b", 40);
    assert_true(has(cache, "a"));
    put_away(cache, "c", 40);
    assert_true(has(cache, "a"));
    assert_false(has(cache, "b"));
    assert_true(has(cache, "c"));
    put_away(cache, "d", 100);
    assert_false(has(cache, "a") || has(cache, "c"));
    assert_true(has(cache, "d"));
    put_away(cache, "e", 101); // larger than all of it: nothing goes for it
    assert_false(has(cache, "e"));
    assert_true(has(cache, "d"));
    gzip_cache_destroy(&cache);
    assert_null(cache);
}

static void of_a_name_there_is_one(void **state) {
    (void)state;
    struct gzip_cache *cache = gzip_cache_create(100);
    put_away(cache, "a", 60);
    const struct gzip_file *old = gzip_cache_take(cache, "a");
    put_away(cache, "a", 50);
    put_away(cache, "b", 50); // fits beside it
    const struct gzip_file *new = gzip_cache_take(cache, "a");
    assert_int_equal(old->size, 60);
    assert_int_equal(new->size, 50);
    assert_true(has(cache, "b"));
    gzip_cache_destroy(&cache);
    assert_int_equal(old->bytes[59], 'a'); // who has it goes on sending it
    gzip_file_release(&old);
    gzip_file_release(&new);
}

static void *ask_much(void *user) {
    struct gzip_cache *cache = user;
    for (int i = 0; i < 3000; i++) {
        char name[2] = {(char)('a' + i * 7 % 5)};
        if (!has(cache, name))
            put_away(cache, name, (size_t)(10 + i % 40));
    }
    return NULL;
}

static void many_may_ask_at_once(void **state) {
    (void)state;
    struct gzip_cache *cache = gzip_cache_create(100);
    pthread_t threads[4];
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, ask_much, cache), 0);
    for (int i = 0; i < 4; i++)
        pthread_join(threads[i], NULL);
    put_away(cache, "z", 10);
    assert_true(has(cache, "z"));
    gzip_cache_destroy(&cache);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_least_recently_used_file_makes_room),
        cmocka_unit_test(of_a_name_there_is_one),
        cmocka_unit_test(many_may_ask_at_once),
    };
    return cmocka_run_group_tests_name("cache", tests, NULL, NULL);
}
