// The key that names those who share the records: text and back, and what is none.
#include "cluster/records_key.h"

#include "test.h"

#include <stdio.h>
#include <string.h>

static struct error err;

static void a_key_is_text_and_back(void **state) {
    (void)state;
    struct records_key key, back;
    char text[RECORDS_KEY_SIZE];
    records_key_begin(&key);
    for (int i = 0; i < STORE_SERVERS_MAX; i++) {
        char name[STORE_NAME_MAX], file[STORE_ID_MAX];
        snprintf(name, sizeof name, "server %d %050d", i, 0);
        records_key_name(file);
        assert_int_equal(records_key_slot(&key, name, file), i);
        assert_int_equal(records_key_slot(&key, "another name", file), i);
    }
    assert_int_equal(records_key_slot(&key, "one more", "f"), -1);
    key.place = key.token = key.hash = UINT64_MAX;
    key.first = 7;
    key.size = 1 << 20;
    records_key_text(&key, text);
    assert_ok(records_key_read(text, &back, &err));
    assert_memory_equal(&key, &back, sizeof key);
}

static void no_two_orders_have_one_name(void **state) {
    (void)state;
    struct records_key one, two;
    records_key_begin(&one);
    records_key_begin(&two);
    assert_string_not_equal(one.order, two.order);
}

static void what_is_no_key_is_refused(void **state) {
    (void)state;
    static const char copy[] = "\"copy\":{\"place\":\"0000000000000000\",\"token\":"
                               "\"0000000000000000\",\"first\":\"0000000000000000\",\"size\":"
                               "\"0000000000000000\",\"hash\":\"0000000000000000\"}";
    static const char *const none[] = {
        "",
        "[]",
        "{}",
        "{\"order\":\"a\",\"servers\":[{\"name\":\"a\",\"file\":\"f\"}]}",
        "{\"order\":\"\",\"servers\":[{\"name\":\"a\",\"file\":\"f\"}],%s}",
        "{\"order\":\"a\",\"servers\":[],%s}",
        "{\"order\":\"a\",\"servers\":[1],%s}",
        "{\"order\":\"a\",\"servers\":{\"name\":\"a\"},%s}",
        "{\"order\":\"000000000000000000000000000000000\",\"servers\":[{\"name\":\"a\",\"file\":"
        "\"f\"}],%s}"};
    struct records_key key;
    char text[RECORDS_KEY_SIZE];
    snprintf(text, sizeof text,
             "{\"order\":\"a\",\"servers\":[{\"name\":\"a\",\"file\":\"f\"}],%s}", copy);
    assert_ok(records_key_read(text, &key, &err));
    for (size_t i = 0; i < sizeof none / sizeof *none; i++) {
        const char *hole = strstr(none[i], "%s");
        snprintf(text, sizeof text, "%.*s%s%s", (int)(hole ? hole - none[i] : 0), none[i],
                 hole ? copy : none[i], hole ? hole + 2 : "");
        assert_int_equal(records_key_read(text, &key, &err), RESULT_FORMAT);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_key_is_text_and_back),
        cmocka_unit_test(no_two_orders_have_one_name),
        cmocka_unit_test(what_is_no_key_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
