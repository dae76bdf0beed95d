// Attempts at tasks in the records: what is kept, found, replaced, refused, and what goes with a
// trainee or a session.
#include "store/attempts.h"
#include "test.h"
#include "unit/store_files.h"

#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct store *store;
static struct error err;
static bool is_new;

#define ADA "00000000000000000000000000000001"
#define EVE "00000000000000000000000000000002"

static int begin(void **state) {
    store_folder_begin(state);
    store = open_records();
    struct store_session ada = a_session(1), eve = a_session(2);
    snprintf(eve.trainee, sizeof eve.trainee, "eve");
    assert_ok(store_put_session(store, &ada, NULL, 0, &err));
    assert_ok(store_put_session(store, &eve, NULL, 0, &err));
    assert_ok(store_add_course(store, "autumn", &err));
    assert_ok(store_enrol(store, "ada", "autumn", &err));
    return 0;
}

static int end(void **state) {
    store_close(&store);
    return store_folder_end(state);
}

static void put(const char *session, int number) {
    const struct attempt_row row = an_attempt(session, number);
    assert_ok(store_attempt_add(store, &row, &is_new, &err));
}

// "1.2 2.1": session and number of each.
struct found {
    char text[512];
};

static void take(void *user, const struct store_cell *cells, int count) {
    struct found *found = user;
    size_t used = strlen(found->text);
    assert_true(count > 20);
    assert_string_equal(cells[0].column, "session");
    assert_string_equal(cells[1].column, "number");
    snprintf(found->text + used, sizeof found->text - used, "%s%c.%lld", used ? " " : "",
             cells[0].text[31], (long long)cells[1].integer);
}

static const char *found(struct attempt_filter filter) {
    static struct found all;
    all.text[0] = '\0';
    if (!filter.limit)
        filter.limit = 100;
    assert_ok(store_attempt_list(store, &filter, take, &all, &err));
    return all.text;
}

static int attempts(void) {
    return row_count(store, LIST_ATTEMPTS);
}

static void an_attempt_is_kept_as_it_was(void **state) {
    (void)state;
    struct attempt_row row = an_attempt(ADA, 3);
    snprintf(row.figures, sizeof row.figures, "{\"path_mm\":120.5}");
    snprintf(row.occurrences, sizeof row.occurrences,
             "[{\"error\":\"bump\",\"tool\":\"probe\",\"step\":333,\"time_s\":1.25}]");
    row.errors = 1;
    row.sentinel = true;
    row.mark_version = 2;
    snprintf(row.verdict, sizeof row.verdict, "not yet");
    snprintf(row.end, sizeof row.end, "sentinel error");
    assert_ok(store_attempt_add(store, &row, &is_new, &err));
    assert_string_equal(
        rows_of(store, LIST_ATTEMPTS, ADA),
        "session=" ADA "|number=3|station=room-1|trainee=ada|trainee_number=1|task=centring|task_version=1|"
        "title=Centring and horizon|file_hash="
        "0000000000000000000000000000000000000000000000000000000000000007|case=tear-radial|"
        "case_hash=000000001234abcd|purpose=practice|hand=right|first_step=300|last_step=390|"
        "begun_utc_ns=6180000000000|time_s=40|goals=4|goals_met=4|errors=1|sentinel=1|"
        "verdict=not yet|end=sentinel error|pass_time_s=75|pass_errors=0|mark_version=2|exam=|"
        "exam_state=|figures={\"path_mm\":120.5}|"
        "occurrences=[{\"error\":\"bump\",\"tool\":\"probe\",\"step\":333,\"time_s\":1.25}]\n");
}

static void one_of_the_same_number_replaces_it(void **state) {
    (void)state;
    put(ADA, 1);
    struct attempt_row row = an_attempt(ADA, 1);
    row.time_s = 41.5;
    assert_true(is_new);
    assert_ok(store_attempt_add(store, &row, &is_new, &err));
    assert_false(is_new);
    assert_int_equal(attempts(), 1);
    assert_non_null(strstr(rows_of(store, LIST_ATTEMPTS, ADA), "|time_s=41.5|"));
    assert_non_null(strstr(rows_of(store, LIST_ATTEMPTS, ADA), "|figures={}|occurrences=[]\n"));
}

static void a_filter_finds_the_newest_first(void **state) {
    (void)state;
    put(ADA, 1);
    put(EVE, 2);
    struct attempt_row row = an_attempt(ADA, 3);
    snprintf(row.task, sizeof row.task, "probing");
    snprintf(row.hand, sizeof row.hand, "left");
    assert_ok(store_attempt_add(store, &row, &is_new, &err));
    assert_string_equal(found((struct attempt_filter){0}), "1.3 2.2 1.1");
    assert_string_equal(found((struct attempt_filter){.limit = 2}), "1.3 2.2");
    assert_string_equal(found((struct attempt_filter){.course = "autumn"}), "1.3 1.1");
    assert_string_equal(found((struct attempt_filter){.course = "none"}), "");
    assert_string_equal(found((struct attempt_filter){.task = "centring"}), "2.2 1.1");
    assert_string_equal(found((struct attempt_filter){.trainee = "eve"}), "2.2");
    assert_string_equal(found((struct attempt_filter){.session = ADA, .number = 1}), "1.1");
    assert_string_equal(found((struct attempt_filter){.hand = "left"}), "1.3");
    assert_string_equal(found((struct attempt_filter){.purpose = "exam"}), "");
    assert_string_equal(found((struct attempt_filter){.from_utc_ns = 60000000000LL * 102}),
                        "1.3 2.2");
    assert_string_equal(found((struct attempt_filter){.to_utc_ns = 60000000000LL * 102}), "1.1");
    assert_string_equal(found((struct attempt_filter){.before_session = EVE, .before_number = 2}),
                        "1.1");
    // of another than whom the list is about: tells nothing
    assert_string_equal(
        found((struct attempt_filter){.trainee = "ada", .before_session = EVE, .before_number = 2}),
        "");
}

static void what_is_wrong_is_refused(void **state) {
    (void)state;
    const struct {
        size_t at, size;
        const void *value;
        enum result result;
    } rows[] = {
#define FIELD(name) offsetof(struct attempt_row, name), sizeof((struct attempt_row *)0)->name
        {FIELD(number), &(int){0}, RESULT_INVALID},
        {FIELD(task), "", RESULT_INVALID},
        {FIELD(task), "a\nb", RESULT_INVALID},
        {FIELD(title), "\xff", RESULT_INVALID},
        {FIELD(task_version), &(int){0}, RESULT_INVALID},
        {FIELD(file_hash), "12", RESULT_INVALID},
        {FIELD(time_s), &(double){-1}, RESULT_INVALID},
        {FIELD(time_s), &(double){__builtin_nan("")}, RESULT_INVALID},
        {FIELD(goals_met), &(int){5}, RESULT_INVALID},
        {FIELD(errors), &(int){-1}, RESULT_INVALID},
        {FIELD(last_step), &(uint64_t){1}, RESULT_INVALID},
        {FIELD(purpose), "fun", RESULT_REFUSED},
        {FIELD(hand), "third", RESULT_REFUSED},
        {FIELD(verdict), "open", RESULT_REFUSED},
        {FIELD(end), "runs", RESULT_REFUSED},
        {FIELD(figures), "{", RESULT_INVALID},
        {FIELD(figures), "[]", RESULT_INVALID},
        {FIELD(occurrences), "none", RESULT_INVALID},
        {FIELD(session), "00000000000000000000000000000009", RESULT_MISSING},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct attempt_row row = an_attempt(ADA, 1);
        char *field = (char *)&row + rows[i].at;
        if (rows[i].size > 8)
            snprintf(field, rows[i].size, "%s", (const char *)rows[i].value);
        else if (rows[i].at == offsetof(struct attempt_row, hand))
            snprintf(field, rows[i].size, "%s", (const char *)rows[i].value);
        else
            memcpy(field, rows[i].value, rows[i].size);
        enum result result = store_attempt_add(store, &row, &is_new, &err);
        if (result != rows[i].result)
            fail_msg("row %zu: %d: %s", i, result, err.text);
    }
    assert_int_equal(attempts(), 0);
}

static void erasing_a_trainee_erases_the_attempts_and_no_others(void **state) {
    (void)state;
    char pseudonym[STORE_NAME_MAX];
    put(ADA, 1);
    put(EVE, 1);
    assert_ok(store_erase_trainee(store, "ada", pseudonym, &err));
    assert_string_equal(found((struct attempt_filter){0}), "2.1");
    put(ADA, 1); // the trace is read again
    assert_string_equal(found((struct attempt_filter){0}), "2.1");
    assert_int_equal(row_count(store, LIST_SESSIONS), 2);
}

static void a_removed_session_takes_its_attempts_with_it(void **state) {
    (void)state;
    struct store_session ada = a_session(1);
    ada.state = STATE_CLOSED;
    ada.end_utc_ns = ada.start_utc_ns + 1;
    assert_ok(store_put_session(store, &ada, NULL, 0, &err));
    put(ADA, 1);
    put(EVE, 1);
    assert_ok(store_remove_session(store, ADA, &err));
    assert_string_equal(found((struct attempt_filter){0}), "2.1");
}

static void a_backup_and_its_restore_keep_them(void **state) {
    (void)state;
    char aside[STORE_TEXT_MAX];
    put(ADA, 1);
    char *before = strdup(rows_of(store, LIST_ATTEMPTS, NULL));
    assert_ok(store_backup(store, in_folder("backup.db"), &err));
    put(ADA, 2);
    store_close(&store);
    assert_ok(store_restore(in_folder("backup.db"), store_path, "tester", aside, &err));
    store = open_records();
    assert_string_equal(rows_of(store, LIST_ATTEMPTS, NULL), before);
    free(before);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)
        TEST(an_attempt_is_kept_as_it_was),
        TEST(one_of_the_same_number_replaces_it),
        TEST(a_filter_finds_the_newest_first),
        TEST(what_is_wrong_is_refused),
        TEST(erasing_a_trainee_erases_the_attempts_and_no_others),
        TEST(a_removed_session_takes_its_attempts_with_it),
        TEST(a_backup_and_its_restore_keep_them),
    };
    return cmocka_run_group_tests_name("store_attempts", tests, NULL, NULL);
}
