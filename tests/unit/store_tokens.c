// Who may come in, as the records keep it: accounts, tokens and codes, and what is read of sessions
// by those who came in.
#include "test.h"
#include "unit/store_files.h"

#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ARGON "$argon2id$v=19$m=8,t=1,p=1$c29tZXNhbHQ$aGFzaA"

static struct error err;
static struct store *store;

static int begin(void **state) {
    store_folder_begin(state);
    store = open_records();
    assert_ok(store_add_trainee(store, "ada", NULL, &err));
    assert_ok(store_add_account(store, "grace", ROLE_INSTRUCTOR, ARGON, NULL, &err));
    assert_ok(store_add_account(store, "ada.l", ROLE_TRAINEE, ARGON, "ada", &err));
    return 0;
}

static int end(void **state) {
    store_close(&store);
    return store_folder_end(state);
}

static const char *hash_of(int number) {
    static char hashes[4][STORE_HASH_MAX];
    static int next;
    char *hash = hashes[next++ % 4];
    snprintf(hash, STORE_HASH_MAX, "%064d", number);
    return hash;
}

static int64_t add(enum store_token_kind kind, const char *account, int number) {
    struct store_principal owner;
    int64_t id, until_ns;
    assert_ok(store_find_account(store, account, &owner, &err));
    assert_ok(store_add_token(store, kind, hash_of(number), &owner,
                              kind == TOKEN_BEARER ? "script" : NULL, &id, &until_ns, &err));
    return id;
}

static bool is_known(int number) {
    struct store_principal visitor;
    enum result result = store_find_token(store, hash_of(number), &visitor, &err);
    assert_true(result == RESULT_OK || result == RESULT_MISSING);
    return result == RESULT_OK;
}

// ---- tokens -------------------------------------------------------------------------------------

static void a_token_says_whose_it_is(void **state) {
    (void)state;
    struct store_principal visitor;
    int64_t cookie = add(TOKEN_COOKIE, "grace", 1);
    add(TOKEN_BEARER, "ada.l", 2);
    assert_ok(store_find_token(store, hash_of(1), &visitor, &err));
    assert_string_equal(visitor.name, "grace");
    assert_string_equal(visitor.actor, "grace");
    assert_string_equal(visitor.trainee, "");
    assert_int_equal(visitor.role, ROLE_INSTRUCTOR);
    assert_int_equal(visitor.token, cookie);
    assert_true(visitor.by_account);
    assert_ok(store_find_token(store, hash_of(2), &visitor, &err));
    assert_string_equal(visitor.name, "ada.l");
    assert_string_equal(visitor.trainee, "ada");
    assert_string_equal(visitor.actor, "trainee 1");
    assert_int_equal(visitor.role, ROLE_TRAINEE);
    assert_false(is_known(3));
}

static void a_code_is_no_token_and_a_token_no_code(void **state) {
    (void)state;
    struct store_principal visitor;
    int64_t until_ns, id;
    add(TOKEN_BEARER, "grace", 1);
    assert_ok(store_add_code(store, "ada", hash_of(2), &until_ns, &err));
    assert_false(is_known(2));
    assert_int_equal(store_find_code(store, hash_of(1), &visitor, &err), RESULT_MISSING);
    for (int i = 0; i < 3; i++) {
        assert_ok(store_find_code(store, hash_of(2), &visitor, &err));
        assert_string_equal(visitor.name, "ada");
        assert_string_equal(visitor.trainee, "ada");
        assert_int_equal(visitor.role, ROLE_TRAINEE);
        assert_false(visitor.by_account);
        assert_ok(store_add_token(store, TOKEN_COOKIE, hash_of(10 + i), &visitor, NULL, &id,
                                  &until_ns, &err));
        assert_true(is_known(10 + i));
    }
    assert_ok(store_add_code(store, "ada", hash_of(4), &until_ns, &err));
    assert_int_equal(store_find_code(store, hash_of(2), &visitor, &err), RESULT_MISSING);
    assert_false(is_known(10)); // what came in by the code before
    assert_int_equal(store_add_code(store, "eve", hash_of(5), &until_ns, &err), RESULT_MISSING);
}

// As if the clock had gone on by so many seconds.
static void let_pass(int64_t seconds) {
    char sql[256];
    snprintf(sql, sizeof sql,
             "UPDATE token SET created_utc_ns = created_utc_ns - %lld000000000, "
             "until_utc_ns = until_utc_ns - %lld000000000, "
             "used_utc_ns = used_utc_ns - %lld000000000",
             (long long)seconds, (long long)seconds, (long long)seconds);
    assert_true(sql_passes("records.db", sql));
}

static void a_cookie_ends_twelve_hours_after_its_last_use(void **state) {
    (void)state;
    const int64_t eleven = 11 * 3600;
    add(TOKEN_COOKIE, "grace", 1);
    for (int i = 0; i < 4; i++) {
        assert_true(is_known(1));
        let_pass(eleven);
    }
    assert_true(is_known(1));
    let_pass(12 * 3600 + 1);
    assert_false(is_known(1));
}

static void a_cookie_ends_a_week_after_it_began_however_much_it_is_used(void **state) {
    (void)state;
    add(TOKEN_COOKIE, "grace", 1);
    for (int hours = 0; hours < 7 * 24 - 1; hours++) {
        let_pass(3600);
        assert_true(is_known(1));
    }
    let_pass(3600 + 1);
    assert_false(is_known(1));
}

// A server of before the rule gave it an end of its own.
static void a_cookie_that_was_made_before_the_rule_ends_too(void **state) {
    (void)state;
    add(TOKEN_COOKIE, "grace", 1);
    let_pass(8 * 86400);
    assert_true(
        sql_passes("records.db", "UPDATE token SET until_utc_ns = until_utc_ns + 700000000000000"));
    assert_false(is_known(1));
}

static void come_in_by_code(const char *trainee, int code, int cookie) {
    struct store_principal visitor;
    int64_t id, until_ns;
    assert_ok(store_add_code(store, trainee, hash_of(code), &until_ns, &err));
    assert_ok(store_find_code(store, hash_of(code), &visitor, &err));
    assert_ok(store_add_token(store, TOKEN_COOKIE, hash_of(cookie), &visitor, NULL, &id, &until_ns,
                              &err));
}

static void a_cookie_of_a_code_ends_with_the_code(void **state) {
    (void)state;
    come_in_by_code("ada", 1, 2);
    for (int i = 0; i < 11; i++) {
        let_pass(3600);
        assert_true(is_known(2));
    }
    let_pass(3600 + 1);
    assert_false(is_known(2));
    come_in_by_code("ada", 3, 4);
    assert_true(sql_passes("records.db", "DELETE FROM token WHERE kind = 'code'"));
    assert_false(is_known(4));
}

static void a_new_code_ends_the_cookies_of_the_old_one_and_no_others(void **state) {
    (void)state;
    struct store_principal visitor;
    int64_t id, until_ns;
    assert_ok(store_add_trainee(store, "eve", NULL, &err));
    add(TOKEN_COOKIE, "ada.l", 1);
    come_in_by_code("eve", 2, 3);
    come_in_by_code("ada", 4, 5);
    assert_ok(store_find_code(store, hash_of(4), &visitor, &err));
    assert_ok(store_add_code(store, "ada", hash_of(6), &until_ns, &err));
    assert_false(is_known(5));
    assert_true(is_known(1) && is_known(3));
    // who was just coming in by the old one
    assert_int_equal(
        store_add_token(store, TOKEN_COOKIE, hash_of(7), &visitor, NULL, &id, &until_ns, &err),
        RESULT_MISSING);
}

static void no_token_after_the_password_has_changed(void **state) {
    (void)state;
    struct store_principal before, in;
    int64_t id, until_ns;
    add(TOKEN_COOKIE, "grace", 1);
    assert_ok(store_find_account(store, "grace", &before, &err));
    assert_ok(store_find_token(store, hash_of(1), &in, &err));
    assert_ok(store_set_password(store, "grace", ARGON "1", &err));
    for (int kind = TOKEN_COOKIE; kind <= TOKEN_BEARER; kind++) {
        assert_int_equal(store_add_token(store, (enum store_token_kind)kind, hash_of(2), &before,
                                         "x", &id, &until_ns, &err),
                         RESULT_MISSING);
        assert_int_equal(store_add_token(store, (enum store_token_kind)kind, hash_of(2), &in, "x",
                                         &id, &until_ns, &err),
                         RESULT_MISSING);
    }
    assert_int_equal(store_change_password(store, &before, ARGON "2", &err), RESULT_MISSING);
    assert_int_equal(row_count(store, LIST_TOKENS), 0);
    assert_ok(store_find_account(store, "grace", &before, &err));
    assert_string_equal(before.password, ARGON "1");
    assert_ok(store_change_password(store, &before, ARGON "2", &err));
}

static void signing_out_everywhere_ends_the_accounts_cookies_and_tokens(void **state) {
    (void)state;
    struct store_principal in;
    int64_t id, until_ns;
    add(TOKEN_COOKIE, "grace", 1);
    add(TOKEN_COOKIE, "ada.l", 2);
    add(TOKEN_BEARER, "ada.l", 3);
    come_in_by_code("ada", 4, 5);
    assert_ok(store_find_token(store, hash_of(2), &in, &err));
    assert_ok(store_sign_out(store, &in, &err));
    assert_false(is_known(2) || is_known(3));
    assert_true(is_known(1) && is_known(5));
    assert_int_equal(
        store_add_token(store, TOKEN_BEARER, hash_of(6), &in, "x", &id, &until_ns, &err),
        RESULT_MISSING);
    assert_ok(store_find_token(store, hash_of(5), &in, &err));
    assert_ok(store_sign_out(store, &in, &err));
    assert_false(is_known(5));
    assert_ok(store_find_code(store, hash_of(4), &in, &err));
    add(TOKEN_COOKIE, "ada.l", 7);
    come_in_by_code("ada", 8, 9);
    assert_ok(store_sign_out_trainee(store, "ada", &err));
    assert_false(is_known(7) || is_known(9));
    assert_int_equal(store_find_code(store, hash_of(8), &in, &err), RESULT_MISSING);
    assert_true(is_known(1));
    assert_ok(store_sign_out_account(store, "grace", &err));
    assert_false(is_known(1));
    assert_int_equal(store_sign_out_account(store, "none", &err), RESULT_MISSING);
    assert_int_equal(store_sign_out_trainee(store, "none", &err), RESULT_MISSING);
    assert_non_null(strstr(rows_of(store, LIST_AUDIT, NULL), "action=sign out|subject=trainee 1"));
}

static void tokens_and_codes_end_however_much_they_are_used(void **state) {
    (void)state;
    struct store_principal visitor;
    int64_t until_ns;
    add(TOKEN_BEARER, "grace", 1);
    assert_true(is_known(1));
    assert_ok(store_add_code(store, "ada", hash_of(2), &until_ns, &err));
    let_pass(11 * 3600);
    assert_ok(store_find_code(store, hash_of(2), &visitor, &err));
    let_pass(3600 + 1);
    assert_int_equal(store_find_code(store, hash_of(2), &visitor, &err), RESULT_MISSING);
    let_pass(364 * 86400LL);
    assert_true(is_known(1));
    let_pass(86400);
    assert_false(is_known(1));
    add(TOKEN_COOKIE, "grace", 3);
    assert_int_equal(row_count(store, LIST_TOKENS), 1); // what has ended is thrown away
}

static void sign_in_works_while_another_program_writes(void **state) {
    (void)state;
    sqlite3 *other;
    add(TOKEN_COOKIE, "grace", 1);
    assert_int_equal(sqlite3_open(store_path, &other), SQLITE_OK);
    assert_int_equal(sqlite3_exec(other, "BEGIN IMMEDIATE", NULL, NULL, NULL), SQLITE_OK);
    assert_true(is_known(1));
    sqlite3_close(other);
}

static void nobody_fills_the_records_with_tokens(void **state) {
    (void)state;
    struct store_principal owner;
    int64_t id, until_ns;
    add(TOKEN_COOKIE, "ada.l", 9999);
    for (int i = 0; i < 40; i++)
        add(TOKEN_COOKIE, "grace", i);
    assert_true(is_known(9999));
    for (int i = 0; i < 40; i++)
        assert_int_equal(is_known(i), i >= 8);
    for (int i = 0; i < 32; i++)
        add(TOKEN_BEARER, "grace", 100 + i);
    assert_ok(store_find_account(store, "grace", &owner, &err));
    assert_int_equal(store_add_token(store, TOKEN_BEARER, hash_of(200), &owner, "one more", &id,
                                     &until_ns, &err),
                     RESULT_LIMIT);
    assert_true(is_known(100) && is_known(131));
}

static void only_its_owner_ends_a_token(void **state) {
    (void)state;
    struct store_principal grace, ada;
    int64_t id = add(TOKEN_BEARER, "grace", 1);
    assert_ok(store_find_account(store, "grace", &grace, &err));
    assert_ok(store_find_account(store, "ada.l", &ada, &err));
    assert_int_equal(store_remove_token(store, &ada, id, &err), RESULT_MISSING);
    assert_true(is_known(1));
    assert_ok(store_remove_token(store, &grace, id, &err));
    assert_false(is_known(1));
    assert_int_equal(store_remove_token(store, &grace, id, &err), RESULT_MISSING);
}

// ---- accounts -----------------------------------------------------------------------------------

static void a_change_of_an_account_ends_what_it_is_signed_in_by(void **state) {
    (void)state;
    add(TOKEN_COOKIE, "grace", 1);
    add(TOKEN_COOKIE, "ada.l", 2);
    add(TOKEN_BEARER, "ada.l", 3);
    assert_int_equal(store_set_password(store, "ada.l", "secret", &err), RESULT_INVALID);
    assert_int_equal(store_set_password(store, "eve", ARGON, &err), RESULT_MISSING);
    assert_true(is_known(2) && is_known(3));
    assert_ok(store_set_password(store, "ada.l", ARGON "1", &err));
    assert_false(is_known(2) || is_known(3));
    add(TOKEN_COOKIE, "ada.l", 4);
    assert_ok(store_set_role(store, "ada.l", ROLE_TECHNICIAN, &err));
    assert_false(is_known(4));
    add(TOKEN_COOKIE, "ada.l", 5);
    assert_ok(store_remove_account(store, "ada.l", &err));
    assert_false(is_known(5));
    assert_true(is_known(1));
    assert_non_null(strstr(rows_of(store, LIST_AUDIT, NULL), "action=password|subject=account 2"));
    assert_non_null(strstr(rows_of(store, LIST_AUDIT, NULL), "action=remove|subject=account 2"));
}

static void the_last_instructor_stays(void **state) {
    (void)state;
    bool has;
    add(TOKEN_COOKIE, "grace", 1);
    assert_ok(store_add_account(store, "nobody", ROLE_INSTRUCTOR, NULL, NULL, &err));
    assert_int_equal(store_remove_account(store, "grace", &err), RESULT_REFUSED);
    assert_int_equal(store_set_role(store, "grace", ROLE_TRAINEE, &err), RESULT_REFUSED);
    assert_ok(store_has_instructor(store, &has, &err));
    assert_true(has && is_known(1));
    assert_ok(store_set_password(store, "nobody", ARGON, &err));
    assert_ok(store_remove_account(store, "grace", &err));
    assert_int_equal(store_remove_account(store, "nobody", &err), RESULT_REFUSED);
}

static void erasing_takes_all_that_signs_the_trainee_in(void **state) {
    (void)state;
    char pseudonym[STORE_NAME_MAX];
    struct store_principal visitor;
    int64_t id, until_ns;
    add(TOKEN_BEARER, "ada.l", 1);
    assert_ok(store_add_code(store, "ada", hash_of(22222), &until_ns, &err));
    assert_ok(store_find_code(store, hash_of(22222), &visitor, &err));
    assert_ok(
        store_add_token(store, TOKEN_COOKIE, hash_of(3), &visitor, NULL, &id, &until_ns, &err));
    add(TOKEN_COOKIE, "grace", 4);
    assert_true(file_has("records.db", hash_of(22222)) ||
                file_has("records.db-wal", hash_of(22222)));
    assert_ok(store_erase_trainee(store, "ada", pseudonym, &err));
    assert_false(is_known(1) || is_known(3));
    assert_int_equal(store_find_code(store, hash_of(22222), &visitor, &err), RESULT_MISSING);
    assert_int_equal(store_add_code(store, pseudonym, hash_of(5), &until_ns, &err), RESULT_MISSING);
    assert_true(is_known(4));
    assert_false(file_has("records.db", hash_of(22222)));
    assert_false(file_has("records.db-wal", hash_of(22222)));
    assert_null(strstr(rows_of(store, LIST_AUDIT, NULL), "ada"));
}

// ---- what is read -------------------------------------------------------------------------------

#define SESSIONS 23

static struct store_session session_number(int i) {
    struct store_session s = a_session((unsigned)i);
    s.start_utc_ns = 1000000000LL * (1000 + i * 7 % SESSIONS / 2); // some begin at one time
    snprintf(s.trainee, sizeof s.trainee, "%s", i % 3 == 0 ? "ada" : i % 3 == 1 ? "eve" : "");
    snprintf(s.case_name, sizeof s.case_name, "%s", i % 2 ? "tear" : "healthy");
    s.state = i == 4 || i == 6 ? STATE_OPEN : STATE_CLOSED;
    return s;
}

static void put_sessions(void) {
    for (int i = 0; i < SESSIONS; i++) {
        struct store_session s = session_number(i);
        struct store_result results[2] = {{"time", "", 1, "s", 100 - i, ""},
                                          {"time", "", 2, "s", i == 9 ? (double)NAN : i, ""}};
        assert_ok(store_put_session(store, &s, results, 2, &err));
    }
    assert_ok(store_add_course(store, "autumn", &err));
    assert_ok(store_add_course(store, "winter", &err));
    assert_ok(store_enrol(store, "eve", "autumn", &err));
}

struct page {
    int numbers[SESSIONS], count;
    char last[STORE_ID_MAX];
};

static void take_session(void *user, const struct store_cell *cells, int count) {
    struct page *page = user;
    assert_true(count > 5 && page->count < SESSIONS);
    snprintf(page->last, sizeof page->last, "%s", cells[0].text);
    page->numbers[page->count++] = (int)strtol(cells[0].text, NULL, 16);
}

static bool fits(const struct store_filter *filter, int i) {
    struct store_session s = session_number(i);
    return (!filter->trainee || !strcmp(filter->trainee, s.trainee)) &&
           (!filter->case_name || !strcmp(filter->case_name, s.case_name)) &&
           (!filter->course || (!strcmp(filter->course, "autumn") && !strcmp(s.trainee, "eve")));
}

// Page by page, each session that fits comes once, and none is older than the one after it.
static void assert_pages(struct store_filter filter) {
    struct page all = {.count = 0};
    int expected = 0;
    char before[STORE_ID_MAX];
    for (int had = -1; had != all.count;) {
        had = all.count;
        assert_ok(store_find_sessions(store, &filter, take_session, &all, &err));
        assert_true(all.count - had <= filter.limit);
        memcpy(before, all.last, sizeof before);
        filter.before = before;
    }
    for (int i = 0; i < SESSIONS; i++)
        expected += fits(&filter, i);
    assert_int_equal(all.count, expected);
    for (int i = 0; i < all.count; i++) {
        assert_true(fits(&filter, all.numbers[i]));
        if (i)
            assert_true(session_number(all.numbers[i]).start_utc_ns <=
                        session_number(all.numbers[i - 1]).start_utc_ns);
        for (int k = 0; k < i; k++)
            assert_int_not_equal(all.numbers[i], all.numbers[k]);
    }
}

static void sessions_come_page_by_page(void **state) {
    (void)state;
    put_sessions();
    for (int limit = 1; limit < 30; limit += 4) {
        assert_pages((struct store_filter){.limit = limit});
        assert_pages((struct store_filter){.trainee = "ada", .limit = limit});
        assert_pages((struct store_filter){.course = "autumn", .limit = limit});
        assert_pages((struct store_filter){.course = "winter", .limit = limit});
        assert_pages((struct store_filter){.case_name = "tear", .trainee = "eve", .limit = limit});
        assert_pages((struct store_filter){.trainee = "' OR 1 --", .limit = limit});
    }
}

struct figures {
    int count;
    double sum, last;
    int64_t version;
};

static void take_figure(void *user, const struct store_cell *cells, int count) {
    struct figures *f = user;
    assert_int_equal(count, 5);
    assert_string_equal(cells[0].text, "time");
    assert_int_equal(cells[4].kind, STORE_REAL);
    if (cells[2].integer == f->version)
        assert_true(cells[4].real >= f->last);
    f->version = cells[2].integer;
    f->last = cells[4].real;
    f->sum += cells[4].real;
    f->count++;
}

static void figures_of_a_course_are_those_of_its_closed_sessions(void **state) {
    (void)state;
    put_sessions();
    const char *courses[] = {NULL, "autumn", "winter"};
    for (int c = 0; c < 3; c++) {
        struct figures got = {0};
        int count = 0;
        double sum = 0;
        struct store_filter filter = {.case_name = "healthy", .course = courses[c]};
        for (int i = 0; i < SESSIONS; i++) {
            if (!fits(&filter, i) || session_number(i).state != STATE_CLOSED)
                continue;
            count += 2;
            sum += 100;
        }
        assert_ok(store_figures_on(store, "healthy", courses[c], false, take_figure, &got, &err));
        assert_int_equal(got.count, count);
        assert_near(got.sum, sum, 1e-9);
    }
    struct figures tear = {0}; // where session 9 has no second figure
    assert_ok(store_figures_on(store, "tear", NULL, false, take_figure, &tear, &err));
    assert_int_equal(tear.count, 2 * 11 - 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)
        TEST(a_token_says_whose_it_is),
        TEST(a_code_is_no_token_and_a_token_no_code),
        TEST(a_cookie_ends_twelve_hours_after_its_last_use),
        TEST(a_cookie_ends_a_week_after_it_began_however_much_it_is_used),
        TEST(a_cookie_that_was_made_before_the_rule_ends_too),
        TEST(a_cookie_of_a_code_ends_with_the_code),
        TEST(a_new_code_ends_the_cookies_of_the_old_one_and_no_others),
        TEST(no_token_after_the_password_has_changed),
        TEST(signing_out_everywhere_ends_the_accounts_cookies_and_tokens),
        TEST(tokens_and_codes_end_however_much_they_are_used),
        TEST(sign_in_works_while_another_program_writes),
        TEST(nobody_fills_the_records_with_tokens),
        TEST(only_its_owner_ends_a_token),
        TEST(a_change_of_an_account_ends_what_it_is_signed_in_by),
        TEST(the_last_instructor_stays),
        TEST(erasing_takes_all_that_signs_the_trainee_in),
        TEST(sessions_come_page_by_page),
        TEST(figures_of_a_course_are_those_of_its_closed_sessions),
    };
    return cmocka_run_group_tests_name("store_tokens", tests, NULL, NULL);
}
