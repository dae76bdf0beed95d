// Signing in: passwords, codes, cookies, tokens, the first instructor; and a password is nowhere
// but in the head of its owner.
#include "api/password.h"
#include "test.h"
#include "unit/api_files.h"
#include "unit/case_knee.h"

#include <dirent.h>
#include <fcntl.h>
#include <pthread.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct error err;

// The cookie that was set last; good for four calls.
static const char *cookie(void) {
    static char values[4][65];
    static int next;
    char *value = values[next++ % 4];
    value[0] = '\0';
    sscanf(answer.cookie, "arthron=%64[0-9a-f];", value);
    assert_int_equal(strlen(value), 64);
    assert_non_null(strstr(answer.cookie, "; Path=/; HttpOnly; SameSite=Strict"));
    return value;
}

static bool is_in(const char *token) {
    struct web_account account;
    enum result result = api_enter(the_api, token, &account);
    bool is = result == RESULT_OK;
    assert_true(is || result == RESULT_MISSING);
    assert_int_equal(ask("GET", "/me", token, NULL), is ? 200 : 401);
    return is;
}

static void run_sql(const char *sql) {
    sqlite3 *db;
    assert_int_equal(sqlite3_open(in_api("records.db"), &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, sql, NULL, NULL, NULL), SQLITE_OK);
    sqlite3_close(db);
}

// ---- passwords ----------------------------------------------------------------------------------

static void a_password_counts_to_its_last_byte_and_has_a_salt(void **state) {
    (void)state;
    char a[PASSWORD_ENCODED], b[PASSWORD_ENCODED], password[PASSWORD_MOST + 1];
    memset(password, 'x', sizeof password);
    password[PASSWORD_MOST] = '\0';
    bool right;
    assert_int_equal(password_encode(password, a, &err), RESULT_OK);
    assert_int_equal(password_encode(password, b, &err), RESULT_OK);
    assert_non_null(strstr(a, "$argon2id$v=19$m=65536,t=3,p=1$"));
    assert_string_not_equal(a, b);
    assert_int_equal(password_is(a, password, &right, &err), RESULT_OK);
    assert_true(right);
    assert_int_equal(password_is(NULL, password, &right, &err), RESULT_OK);
    assert_false(right);
    password[PASSWORD_MOST - 1] = 'y';
    assert_int_equal(password_is(a, password, &right, &err), RESULT_OK);
    assert_false(right);
}

static void a_password_has_ten_characters_at_least(void **state) {
    (void)state;
    char password[PASSWORD_MOST + 2];
    memset(password, 'x', sizeof password);
    password[PASSWORD_MOST + 1] = '\0';
    assert_int_equal(password_check(password, &err), RESULT_INVALID);
    password[PASSWORD_MOST] = '\0';
    assert_int_equal(password_check(password, &err), RESULT_OK);
    assert_int_equal(password_check("123456789", &err), RESULT_INVALID);
    assert_int_equal(password_check("äöüäöüäöü", &err), RESULT_INVALID);
    assert_int_equal(password_check("äöüäöüäöüä", &err), RESULT_OK);
}

static void the_right_password_signs_in(void **state) {
    (void)state;
    struct web_account account;
    give_password("ada.l");
    assert_int_equal(sign_in("ada.l", PASSWORD), 200);
    assert_string_equal(text_at("account.name"), "ada.l");
    assert_string_equal(text_at("account.role"), "trainee");
    assert_string_equal(text_at("account.trainee"), "ada");
    const char *token = cookie();
    assert_int_equal(api_enter(the_api, token, &account), RESULT_OK);
    assert_string_equal(account.name, "ada.l");
    assert_string_equal(account.role, "trainee");
    assert_string_equal(account.trainee, "ada");
    assert_int_equal(ask("GET", "/me", token, NULL), 200);
    assert_string_equal(text_at("courses.0"), "autumn");
    assert_int_equal(sign_in("ada.l", PASSWORD), 200);
    assert_string_not_equal(cookie(), token);
    assert_int_equal(ask("POST", "/sign-out", token, "{}"), 204);
    assert_non_null(strstr(answer.cookie, "arthron=; "));
    assert_non_null(strstr(answer.cookie, "Max-Age=0"));
    assert_false(is_in(token));
    assert_false(is_in(""));
    assert_false(is_in("0"));
}

// ---- codes, tokens, ends ------------------------------------------------------------------------

static void a_code_signs_its_trainee_in_until_it_ends(void **state) {
    (void)state;
    char body[64];
    assert_int_equal(ask("POST", "/trainees/ada/code", token_of("grace"), "{}"), 201);
    assert_int_equal(strlen(text_at("code")), 8);
    double left_s = number_at("until_utc_s") - (double)time(NULL);
    assert_true(left_s > 12 * 3600 - 10 && left_s < 12 * 3600 + 10);
    snprintf(body, sizeof body, "{\"code\":\"%.4s %s\"}", text_at("code"), text_at("code") + 4);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(ask("POST", "/sign-in", NULL, body), 200);
        assert_string_equal(text_at("account.name"), "ada");
        assert_string_equal(text_at("account.role"), "trainee");
        assert_string_equal(text_at("account.trainee"), "ada");
        assert_true(is_in(cookie()));
    }
    run_sql("UPDATE token SET until_utc_ns = 1 WHERE kind = 'code'");
    assert_int_equal(ask("POST", "/sign-in", NULL, body), 401);
    assert_string_equal(error_code(), "wrong_code");
}

static void a_program_has_a_token_until_it_is_taken_away(void **state) {
    (void)state;
    char token[80], path[32];
    const char *grace = token_of("grace"), *tom = token_of("tom");
    assert_int_equal(ask("POST", "/tokens", grace, "{\"name\":\"night\"}"), 201);
    snprintf(token, sizeof token, "%s", text_at("token"));
    snprintf(path, sizeof path, "/tokens/%.0f", number_at("id"));
    assert_int_equal(ask("GET", "/accounts", token, NULL), 200);
    assert_int_equal(ask("GET", "/tokens", token, NULL), 200);
    assert_int_equal(json_array_size(json_object_get(said, "tokens")), 2);
    assert_string_equal(text_at("tokens.1.name"), "night");
    assert_string_equal(text_at("tokens.1.kind"), "token");
    assert_null(strstr(answer.body, "hash"));
    assert_null(strstr(answer.body, token));
    assert_int_equal(ask("DELETE", path, tom, NULL), 404);
    assert_true(is_in(token));
    assert_int_equal(ask("DELETE", path, grace, NULL), 204);
    assert_false(is_in(token));
    assert_true(is_in(grace));
}

static void ended_tokens_belong_to_nobody(void **state) {
    (void)state;
    const char *token = token_of("grace");
    assert_true(is_in(token));
    run_sql("UPDATE token SET until_utc_ns = 1");
    assert_false(is_in(token));
    assert_int_equal(ask("GET", "/accounts", token, NULL), 401);
    assert_string_equal(error_code(), "not_signed_in");
}

static void an_erased_trainee_is_out(void **state) {
    (void)state;
    char pseudonym[STORE_NAME_MAX];
    const char *tokens[] = {token_of("ada.l"), token_of_code("ada")};
    struct store *store = api_store();
    assert_true(is_in(tokens[0]) && is_in(tokens[1]));
    assert_int_equal(store_erase_trainee(store, "ada", pseudonym, &err), RESULT_OK);
    store_close(&store);
    assert_false(is_in(tokens[0]) || is_in(tokens[1]));
}

static void a_new_password_ends_what_came_in_by_the_old_one(void **state) {
    (void)state;
    give_password("tom");
    const char *token = token_of("tom");
    static const char body[] =
        "{\"password\":\"" PASSWORD "\",\"new_password\":\"another secret\"}";
    assert_int_equal(ask("PATCH", "/me", token, body), 204);
    assert_false(is_in(token));
    assert_int_equal(sign_in("tom", PASSWORD), 401);
    assert_int_equal(sign_in("tom", "another secret"), 200);
    token = cookie();
    assert_int_equal(ask("PATCH", "/me", token, body), 401);
    assert_string_equal(error_field(), "password");
    assert_true(is_in(token));
    assert_int_equal(
        ask("PATCH", "/accounts/tom", token_of("grace"), "{\"password\":\"a third secret\"}"), 204);
    assert_false(is_in(token));
    assert_int_equal(sign_in("tom", "a third secret"), 200);
    assert_int_equal(ask("PATCH", "/me", token_of_code("ada"), body), 403);
}

// ---- a change while somebody signs in -----------------------------------------------------------

#define SIGNERS 20
#define ROUNDS 30

struct signer {
    pthread_t thread;
    char address[32], name[32], cookie[65];
};

static void *sign_in_once(void *user) {
    struct signer *s = user;
    char body[128];
    struct web_response response = {0};
    snprintf(body, sizeof body, "{\"name\":\"%s\",\"password\":\"" PASSWORD "\"}", s->name);
    const struct web_request request = {.method = "POST",
                                        .path = "/api/v1/sign-in",
                                        .query = "",
                                        .body = body,
                                        .size = strlen(body),
                                        .address = s->address};
    api_answer(the_api, &request, &response);
    sscanf(response.cookie, "arthron=%64[0-9a-f];", s->cookie);
    free(response.body);
    return NULL;
}

static void add_account(const char *name) {
    struct store *store = api_store();
    assert_int_equal(store_add_account(store, name, ROLE_TECHNICIAN, ENCODED, NULL, &err),
                     RESULT_OK);
    store_close(&store);
}

static void no_cookie_of_an_old_password_outlives_its_change(void **state) {
    (void)state;
    for (int round = 0; round < ROUNDS; round++) {
        struct signer signers[SIGNERS] = {0};
        char name[32];
        snprintf(name, sizeof name, "account-%d", round);
        add_account(name);
        for (int i = 0; i < SIGNERS; i++) {
            memcpy(signers[i].name, name, sizeof name);
            snprintf(signers[i].address, sizeof signers[i].address, "10.%d.%d.1", round + 1, i);
            assert_int_equal(pthread_create(&signers[i].thread, NULL, sign_in_once, &signers[i]),
                             0);
        }
        usleep((useconds_t)(round % 10) * 1000);
        struct store *store = api_store();
        assert_int_equal(store_set_password(store, name, NO_PASSWORD, &err), RESULT_OK);
        store_close(&store);
        for (int i = 0; i < SIGNERS; i++)
            pthread_join(signers[i].thread, NULL);
        for (int i = 0; i < SIGNERS; i++)
            assert_false(signers[i].cookie[0] && is_in(signers[i].cookie));
    }
}

// ---- the first instructor -----------------------------------------------------------------------

static int first(const char *secret, const char *name) {
    char body[256];
    snprintf(body, sizeof body, "{\"secret\":\"%s\",\"name\":\"%s\",\"password\":\"%s\"}", secret,
             name, PASSWORD);
    return ask("POST", "/first", NULL, body);
}

static void the_link_makes_the_first_instructor_once(void **state) {
    (void)state;
    char secret[65];
    snprintf(secret, sizeof secret, "%s", api_first_secret(the_api));
    assert_int_equal(strlen(secret), 64);
    assert_int_equal(first("", "grace"), 401);
    assert_int_equal(first("0123", "grace"), 401);
    assert_string_equal(error_code(), "wrong_secret");
    assert_int_equal(first(secret, ""), 400);
    assert_int_equal(first(secret, "grace"), 201);
    assert_string_equal(text_at("account.role"), "instructor");
    assert_true(is_in(cookie()));
    assert_int_equal(first(secret, "eve"), 401);
    assert_int_equal(first("", "eve"), 401);
    assert_int_equal(sign_in("grace", PASSWORD), 200);
    api_restart();
    assert_string_equal(api_first_secret(the_api), "");
}

static void the_link_does_nothing_once_there_is_an_instructor(void **state) {
    (void)state;
    char old[65];
    snprintf(old, sizeof old, "%s", api_first_secret(the_api));
    api_restart();
    assert_string_not_equal(api_first_secret(the_api), old);
    assert_int_equal(first(old, "eve"), 401);
    struct store *store = api_store();
    assert_int_equal(store_add_account(store, "grace", ROLE_INSTRUCTOR, NO_PASSWORD, NULL, &err),
                     RESULT_OK);
    store_close(&store);
    assert_int_equal(first(api_first_secret(the_api), "eve"), 409);
}

// ---- where secrets are not ----------------------------------------------------------------------

// In any file of the folder.
static bool is_in_files(const char *text) {
    bool found = false;
    DIR *folder = opendir(api_dir);
    assert_non_null(folder);
    for (struct dirent *entry; (entry = readdir(folder));) {
        size_t size;
        if (entry->d_type != DT_REG)
            continue;
        char *bytes = read_file(api_dir, entry->d_name, &size);
        found = found || memmem(bytes, size, text, strlen(text));
        free(bytes);
    }
    closedir(folder);
    return found;
}

static void secrets_are_in_no_file_and_in_no_log(void **state) {
    (void)state;
    char code[16], token[80], cookies[80], body[64];
    int log = open(in_api("log"), O_CREAT | O_WRONLY | O_APPEND, 0600), old = dup(2);
    dup2(log, 2);
    give_password("grace");
    assert_int_equal(sign_in("grace", PASSWORD), 200);
    snprintf(cookies, sizeof cookies, "%s", cookie());
    assert_int_equal(ask("POST", "/tokens", cookies, "{\"name\":\"night\"}"), 201);
    snprintf(token, sizeof token, "%s", text_at("token"));
    assert_int_equal(ask("POST", "/trainees/ada/code", cookies, "{}"), 201);
    snprintf(code, sizeof code, "%s", text_at("code"));
    snprintf(body, sizeof body, "{\"code\":\"%s\"}", code);
    assert_int_equal(ask("POST", "/sign-in", NULL, body), 200);
    for (int i = 0; i < 6; i++)
        sign_in("grace", "wrong but telling");
    dup2(old, 2);
    close(log);
    close(old);
    assert_true(is_in_files("too many sign-ins from 10.0.0.5 (1 refused"));
    assert_true(is_in_files("$argon2id$"));
    assert_true(is_in_files("trainee 1")); // the actor, not by name
    assert_false(is_in_files(PASSWORD));
    assert_false(is_in_files("wrong but telling"));
    assert_false(is_in_files(cookies));
    assert_false(is_in_files(token));
    assert_false(is_in_files(code));
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, api_begin, api_end)
#define TEST_NEW(f) cmocka_unit_test_setup_teardown(f, api_begin_new, api_end)
        cmocka_unit_test(a_password_counts_to_its_last_byte_and_has_a_salt),
        cmocka_unit_test(a_password_has_ten_characters_at_least),
        TEST(the_right_password_signs_in),
        TEST(a_code_signs_its_trainee_in_until_it_ends),
        TEST(a_program_has_a_token_until_it_is_taken_away),
        TEST(ended_tokens_belong_to_nobody),
        TEST(an_erased_trainee_is_out),
        TEST(a_new_password_ends_what_came_in_by_the_old_one),
        TEST(no_cookie_of_an_old_password_outlives_its_change),
        TEST_NEW(the_link_makes_the_first_instructor_once),
        TEST_NEW(the_link_does_nothing_once_there_is_an_instructor),
        TEST(secrets_are_in_no_file_and_in_no_log),
    };
    return cmocka_run_group_tests_name("api_sign_in", tests, NULL, NULL);
}
