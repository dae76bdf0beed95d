// Who is wrong too often waits, and keeps out nobody else.
#include "test.h"
#include "unit/api_files.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void a_wrong_name_is_answered_as_a_wrong_password_is(void **state) {
    (void)state;
    char text[256];
    give_password("tom");
    assert_int_equal(sign_in("tom", "wrong password"), 401);
    assert_string_equal(error_code(), "wrong_password");
    snprintf(text, sizeof text, "%s", answer.body);
    assert_int_equal(sign_in("nobody", PASSWORD), 401);
    assert_string_equal(answer.body, text);
    assert_int_equal(sign_in("grace", PASSWORD), 401);
    assert_string_equal(answer.body, text);
    assert_string_equal(answer.cookie, "");
}

static void five_wrong_passwords_keep_out_one_name_at_one_address(void **state) {
    (void)state;
    static const char right[] = "{\"name\":\"tom\",\"password\":\"" PASSWORD "\"}";
    char body[64];
    give_password("tom");
    give_password("grace");
    assert_int_equal(ask("POST", "/trainees/ada/code", token_of("grace"), "{}"), 201);
    snprintf(body, sizeof body, "{\"code\":\"%s\"}", text_at("code"));
    for (int i = 0; i < 5; i++)
        assert_int_equal(sign_in("tom", "wrong password"), 401);
    assert_int_equal(sign_in("tom", PASSWORD), 429);
    assert_string_equal(error_code(), "too_many");
    assert_in_range(answer.retry_after_s, 1, 5);
    assert_int_equal(sign_in("grace", PASSWORD), 200); // the rest of the hall is not kept out
    assert_int_equal(ask("POST", "/sign-in", NULL, body), 200);
    assert_int_equal(ask_from("10.0.0.6", "POST", "/sign-in", NULL, right), 200);
}

static void a_hall_may_be_wrong_sixty_times_and_waits_two_seconds_then(void **state) {
    (void)state;
    for (int i = 0; i < 60; i++)
        assert_int_equal(ask("POST", "/sign-in", NULL, "{\"code\":\"ABCDEFGH\"}"), 401);
    assert_int_equal(ask("POST", "/sign-in", NULL, "{\"code\":\"ABCDEFGH\"}"), 429);
    assert_in_range(answer.retry_after_s, 1, 2);
    assert_int_equal(sign_in("nobody", "wrong password"), 401); // passwords count by themselves
}

// The value of the device cookie that was set last.
static const char *device_cookie(void) {
    static char values[2][97];
    static int next;
    char *value = values[next++ % 2];
    assert_int_equal(sscanf(answer.second_cookie, "arthron-device=%96[0-9a-f];", value), 1);
    assert_int_equal(strlen(value), 96);
    assert_non_null(strstr(answer.second_cookie, "; Path=/api/v1; Max-Age=7776000; HttpOnly"));
    return value;
}

static void whoever_signed_in_here_before_passes_others_who_guess(void **state) {
    (void)state;
    static const char wrong[] = "{\"name\":\"tom\",\"password\":\"wrong\"}";
    give_password("tom");
    give_password("grace");
    assert_int_equal(sign_in("tom", PASSWORD), 200);
    const char *known = device_cookie();
    for (int i = 0; i < 30; i++) {
        char address[32];
        snprintf(address, sizeof address, "10.0.1.%d", i / 5);
        assert_int_equal(ask_from(address, "POST", "/sign-in", NULL, wrong), 401);
    }
    for (int i = 0; i < 5; i++)
        sign_in("tom", "wrong password");
    assert_int_equal(sign_in("tom", PASSWORD), 429);
    device = known;
    assert_int_equal(sign_in("tom", PASSWORD), 200);
    assert_string_equal(answer.second_cookie, ""); // it has one
    for (int i = 0; i < 5; i++)                    // it cannot guess without an end
        assert_int_equal(sign_in("tom", "wrong password"), 401);
    assert_int_equal(sign_in("tom", PASSWORD), 429);
    assert_int_equal(sign_in("grace", PASSWORD), 200); // it says nothing about others
    assert_string_not_equal(device_cookie(), known);
    device = NULL;
}

static void whoever_is_signed_in_changes_the_password_while_others_guess(void **state) {
    (void)state;
    static const char body[] =
        "{\"password\":\"" PASSWORD "\",\"new_password\":\"another secret\"}";
    give_password("tom");
    const char *token = token_of("tom");
    for (int i = 0; i < 6; i++)
        sign_in("tom", "wrong password");
    assert_int_equal(sign_in("tom", PASSWORD), 429);
    assert_int_equal(ask("PATCH", "/me", token, body), 204);
}

static void only_from_many_addresses_is_the_owner_of_a_name_kept_out(void **state) {
    (void)state;
    static const char right[] = "{\"name\":\"tom\",\"password\":\"" PASSWORD "\"}";
    static const char wrong[] = "{\"name\":\"tom\",\"password\":\"wrong\"}";
    give_password("tom");
    for (int i = 0; i < 30; i++) {
        char address[32];
        snprintf(address, sizeof address, "10.0.1.%d", i / 5);
        assert_int_equal(ask_from(address, "POST", "/sign-in", NULL, wrong), 401);
        if (i == 4)
            assert_int_equal(ask_from(address, "POST", "/sign-in", NULL, right), 429);
        if (i == 4 || i == 28)
            assert_int_equal(ask_from("10.0.2.1", "POST", "/sign-in", NULL, right), 200);
    }
    assert_int_equal(ask_from("10.0.2.1", "POST", "/sign-in", NULL, right), 429);
    assert_int_equal(ask_from("10.0.2.1", "POST", "/sign-in", NULL, "{\"code\":\"ABCDEFGH\"}"),
                     401);
}

static void right_passwords_wait_where_there_are_very_many(void **state) {
    (void)state;
    give_password("tom");
    give_password("grace");
    for (int i = 0; i < 30; i++)
        assert_int_equal(sign_in("tom", PASSWORD), 200);
    assert_int_equal(sign_in("tom", PASSWORD), 429);
    assert_int_equal(sign_in("tom", "wrong password"), 429);
    assert_int_equal(sign_in("grace", PASSWORD), 200);
}

static int count_audit(const char *action, const char *subject) {
    int count = 0;
    size_t i;
    json_t *row;
    assert_int_equal(ask("GET", "/audit?limit=1000", token_of("grace"), NULL), 200);
    json_array_foreach(json_object_get(said, "audit"), i, row) count +=
        !strcmp(json_string_value(json_object_get(row, "action")), action) &&
        !strcmp(json_string_value(json_object_get(row, "subject")), subject);
    return count;
}

// However slowly somebody guesses; and one who guesses fast does not fill the log.
static void wrong_tries_leave_a_trace_and_not_one_each(void **state) {
    (void)state;
    char body[64];
    give_password("tom");
    assert_int_equal(sign_in("tom", "wrong password"), 401);
    assert_int_equal(sign_in("nobody", "wrong password"), 401);
    assert_int_equal(count_audit("wrong password", "account 2"), 1);
    assert_int_equal(count_audit("wrong password", "no account"), 1);
    for (int i = 0; i < 50; i++) {
        snprintf(body, sizeof body, "{\"code\":\"ABCDEF%02d\"}", 22 + i);
        assert_int_equal(ask("POST", "/sign-in", NULL, body), 401);
    }
    assert_int_equal(count_audit("wrong code", "code"), 1);
    assert_int_equal(count_audit("wrong code", "code, 2 within an hour"), 1);
    assert_int_equal(count_audit("wrong code", "code, 3 within an hour"), 0);
    assert_int_equal(count_audit("wrong code", "code, 32 within an hour"), 1);
    assert_null(strstr(answer.body, "nobody"));
    assert_null(strstr(answer.body, "ABCDEF"));
}

static void *knock(void *user) {
    static const char body[] = "{\"code\":\"ABCDEFGH\"}";
    struct web_response response = {0};
    const struct web_request request = {.method = "POST",
                                        .path = "/api/v1/sign-in",
                                        .query = "",
                                        .body = body,
                                        .size = strlen(body),
                                        .address = "10.0.0.9"};
    (void)user;
    api_answer(the_api, &request, &response);
    free(response.body);
    return response.status == 401 ? "let in" : NULL;
}

static void at_once_no_more_are_wrong_than_one_after_the_other(void **state) {
    (void)state;
    pthread_t threads[70];
    int tried = 0;
    for (int i = 0; i < 70; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, knock, NULL), 0);
    for (int i = 0; i < 70; i++) {
        void *was;
        pthread_join(threads[i], &was);
        tried += was != NULL;
    }
    assert_int_equal(tried, 60);
}

int main(void) {
#define TEST(f) cmocka_unit_test_setup_teardown(f, api_begin, api_end)
    const struct CMUnitTest tests[] = {
        TEST(a_wrong_name_is_answered_as_a_wrong_password_is),
        TEST(five_wrong_passwords_keep_out_one_name_at_one_address),
        TEST(a_hall_may_be_wrong_sixty_times_and_waits_two_seconds_then),
        TEST(whoever_signed_in_here_before_passes_others_who_guess),
        TEST(whoever_is_signed_in_changes_the_password_while_others_guess),
        TEST(only_from_many_addresses_is_the_owner_of_a_name_kept_out),
        TEST(right_passwords_wait_where_there_are_very_many),
        TEST(wrong_tries_leave_a_trace_and_not_one_each),
        TEST(at_once_no_more_are_wrong_than_one_after_the_other),
    };
    return cmocka_run_group_tests_name("api_guess", tests, NULL, NULL);
}
