// What a server answers that lacks memory or places, or is still reading; and that nobody gets past
// a sign-out meanwhile.
#include "api/password.h"
#include "test.h"
#include "unit/api_files.h"

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#define MOST_S 10 // that something waits for a test

static struct error err;

// ---- memory -------------------------------------------------------------------------------------

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) // they map what they like
#define MIB ((rlim_t)1 << 20)

static void set_password(const char *account, const char *encoded) {
    struct store *store = api_store();
    assert_int_equal(store_set_password(store, account, encoded, &err), RESULT_OK);
    store_close(&store);
}

static void limit_memory(rlim_t more) {
    struct rlimit limit;
    unsigned long pages;
    FILE *file = fopen("/proc/self/statm", "re");
    assert_true(file && fscanf(file, "%lu", &pages) == 1);
    fclose(file);
    assert_int_equal(getrlimit(RLIMIT_AS, &limit), 0);
    limit.rlim_cur = more ? pages * (rlim_t)getpagesize() + more : limit.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_AS, &limit), 0);
}

static void assert_no_memory(int status) {
    assert_int_equal(status, 503);
    assert_string_equal(error_code(), "busy");
    assert_true(answer.retry_after_s > 0);
}

// Often enough for wrong ones to have to wait.
static void without_memory_a_password_is_neither_right_nor_wrong(void **state) {
    (void)state;
    static const char body[] =
        "{\"password\":\"" PASSWORD "\",\"new_password\":\"another secret\"}";
    char encoded[PASSWORD_ENCODED];
    assert_int_equal(password_encode(PASSWORD, encoded, &err), RESULT_OK);
    set_password("ada.l", encoded);
    give_password("tom");
    const char *ada = token_of("ada.l"), *tom = token_of("tom"), *grace = token_of("grace");
    limit_memory(32 * MIB);
    for (int i = 0; i < 7; i++) {
        assert_no_memory(sign_in("ada.l", PASSWORD));
        assert_no_memory(sign_in("nobody", PASSWORD));
        assert_no_memory(ask("PATCH", "/me", ada, body));
        assert_no_memory(ask("PATCH", "/me", tom, body)); // no memory for the new one
    }
    assert_no_memory(ask("PATCH", "/accounts/tom", grace, "{\"password\":\"another secret\"}"));
    limit_memory(0);
    assert_int_equal(sign_in("ada.l", PASSWORD), 200);
    assert_int_equal(sign_in("tom", PASSWORD), 200);
    assert_int_equal(ask("GET", "/audit", grace, NULL), 200);
    assert_null(strstr(answer.body, "wrong password"));
}
#endif

// ---- a sign-out while somebody signs in ---------------------------------------------------------

// Between these two a password is looked at.
static struct store_principal find(struct store *store) {
    struct store_principal found;
    assert_int_equal(store_find_account(store, "ada.l", &found, &err), RESULT_OK);
    return found;
}

static enum result enter(struct store *store, const struct store_principal *who) {
    static int number;
    char hash[65];
    int64_t id, until_ns;
    snprintf(hash, sizeof hash, "%064d", number++);
    return store_add_token(store, TOKEN_COOKIE, hash, who, NULL, &id, &until_ns, &err);
}

static void nobody_comes_in_behind_a_sign_out_everywhere(void **state) {
    (void)state;
    struct store *store = api_store();
    struct store_principal ada = find(store);
    assert_int_equal(store_sign_out_account(store, "tom", &err), RESULT_OK);
    assert_int_equal(enter(store, &ada), RESULT_OK);
    assert_int_equal(store_sign_out_account(store, "ada.l", &err), RESULT_OK);
    assert_int_equal(enter(store, &ada), RESULT_MISSING);
    ada = find(store);
    assert_int_equal(enter(store, &ada), RESULT_OK);
    assert_int_equal(store_sign_out_trainee(store, "ada", &err), RESULT_OK);
    assert_int_equal(enter(store, &ada), RESULT_MISSING);
    store_close(&store);
}

// ---- reports ------------------------------------------------------------------------------------

static sem_t begun, let_go;
static atomic_bool ended;

static struct timespec in_time(void) {
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += MOST_S;
    return until;
}

static void hold(void) {
    struct timespec until = in_time();
    sem_post(&begun);
    sem_timedwait(&let_go, &until);
    atomic_store(&ended, true);
}

static void hold_ready(void) {
    sem_init(&begun, 0, 0);
    sem_init(&let_go, 0, 0);
    atomic_store(&ended, false);
}

static void *ask_for_report(void *token) {
    struct web_response response = {0};
    const struct web_request request = {.method = "GET",
                                        .path = "/api/v1/sessions/" SESSION_ADA "/report",
                                        .query = "",
                                        .body = "",
                                        .token = token,
                                        .address = "10.0.0.7"};
    api_answer(the_api, &request, &response);
    free(response.body);
    return NULL;
}

static void trainees_leave_a_report_to_staff(void **state) {
    (void)state;
    char ada[65], eve[65], grace[65];
    pthread_t thread;
    struct timespec until = in_time();
    snprintf(ada, sizeof ada, "%s", token_of("ada.l"));
    snprintf(eve, sizeof eve, "%s", token_of_code("eve"));
    snprintf(grace, sizeof grace, "%s", token_of("grace"));
    hold_ready();
    api_on_report = hold;
    assert_int_equal(pthread_create(&thread, NULL, ask_for_report, ada), 0);
    assert_int_equal(sem_timedwait(&begun, &until), 0);
    api_on_report = NULL;
    assert_int_equal(ask("GET", "/sessions/" SESSION_EVE "/report", eve, NULL), 503);
    assert_true(answer.retry_after_s > 0);
    assert_int_equal(ask("GET", "/sessions/" SESSION_EVE "/report", grace, NULL), 200);
    sem_post(&let_go);
    pthread_join(thread, NULL);
    assert_int_equal(ask("GET", "/sessions/" SESSION_EVE "/report", eve, NULL), 200);
}

// ---- cases --------------------------------------------------------------------------------------

static enum result check_slowly(const char *dir, uint64_t *out_hash, struct error *why) {
    (void)dir;
    (void)out_hash;
    hold();
    return (fail)(why, RESULT_TIMEOUT, "it takes too long");
}

static void nobody_waits_for_a_case_that_is_read(void **state) {
    (void)state;
    const char *token = token_of("ada.l");
    hold_ready();
    api_checker = check_slowly;
    api_restart();
    assert_int_equal(ask("GET", "/cases", token, NULL), 200);
    assert_int_equal(ask("GET", "/cases/healthy", token, NULL), 200);
    assert_int_equal(ask("GET", "/cases/healthy/anatomy.glb", token, NULL), 200);
    assert_false(atomic_load(&ended));
    assert_int_equal(ask("GET", "/cases", token, NULL), 200);
    assert_string_equal(text_at("cases.0.name"), "healthy");
    assert_string_equal(text_at("cases.0.grade_reason"), "the server is reading it");
    for (int i = 0; i < 4; i++)
        sem_post(&let_go);
    api_wait_for_cases(token);
    assert_string_equal(text_at("cases.0.grade"), "broken");
    api_checker = NULL;
}

int main(void) {
#define TEST(f) cmocka_unit_test_setup_teardown(f, api_begin, api_end)
    const struct CMUnitTest tests[] = {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
        TEST(without_memory_a_password_is_neither_right_nor_wrong),
#endif
        TEST(nobody_comes_in_behind_a_sign_out_everywhere),
        TEST(trainees_leave_a_report_to_staff),
        TEST(nobody_waits_for_a_case_that_is_read),
    };
    return cmocka_run_group_tests_name("api_busy", tests, NULL, NULL);
}
