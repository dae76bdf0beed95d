// Which sessions are removed because they are kept no longer, and which never are.
#include "records/retention.h"

#include "base/clock.h"
#include "test.h"
#include "unit/store_files.h"

#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define DAY_NS (86400 * NS_PER_S)
#define SESSIONS 6

static struct error err;

// Session i ended i + 1 days ago; its trace has 1000 bytes, and nobody has read it lately.
static void put_sessions(struct store *store) {
    static const char bytes[1000];
    static const struct timespec long_ago[] = {{.tv_sec = 1000}, {.tv_sec = 1000}};
    char name[32];
    mkdir(in_folder("traces"), 0700);
    for (unsigned i = 0; i < SESSIONS; i++) {
        struct store_session s = a_session(i + 1);
        snprintf(name, sizeof name, "traces/%u.trace", i);
        put_file(name, bytes, sizeof bytes);
        snprintf(s.trace, sizeof s.trace, "%s", in_folder(name));
        utimensat(AT_FDCWD, s.trace, long_ago, 0);
        s.end_utc_ns = clock_utc_ns() - (i + 1) * DAY_NS - NS_PER_S;
        s.start_utc_ns = s.end_utc_ns - NS_PER_S;
        s.state = STATE_CLOSED;
        s.trace_is_read = true;
        assert_ok(store_put_session(store, &s, NULL, 0, &err));
    }
}

static int begin(void **state) {
    store_folder_begin(state);
    struct store *store = open_records();
    put_sessions(store);
    store_close(&store);
    return 0;
}

static void change(const char *sql) {
    assert_true(sql_passes("records.db", sql));
}

static void attempt_of(int session, const char *purpose) {
    char id[STORE_ID_MAX];
    bool is_new;
    struct store *store = open_records();
    snprintf(id, sizeof id, "%032x", session + 1);
    struct attempt_row row = an_attempt(id, 1);
    snprintf(row.purpose, sizeof row.purpose, "%s", purpose);
    assert_ok(store_attempt_add(store, &row, &is_new, &err));
    store_close(&store);
}

// "0 1 2": the sessions whose traces are left. They have rows, and no others have.
static const char *left(void) {
    static char text[64];
    char name[32];
    int count = 0;
    text[0] = '\0';
    for (int i = 0; i < SESSIONS; i++) {
        snprintf(name, sizeof name, "traces/%d.trace", i);
        if (access(in_folder(name), F_OK))
            continue;
        count++;
        snprintf(text + strlen(text), sizeof text - strlen(text), "%s%d", text[0] ? " " : "", i);
    }
    struct store *store = open_records();
    assert_int_equal(row_count(store, LIST_SESSIONS), count);
    store_close(&store);
    return text;
}

// Looks once.
static struct retention_figures look(const struct retention_config *of) {
    struct retention_config config = *of;
    config.records = store_path;
    config.traces_dir = in_folder("traces");
    struct retention *retention = retention_start(&config);
    struct retention_figures figures;
    assert_non_null(retention);
    do {
        usleep(1000);
        figures = retention_figures(retention);
    } while (!figures.traces_bytes);
    retention_stop(&retention);
    assert_null(retention);
    return figures;
}

static struct retention_figures keep(int days, uint64_t bytes, int notice_s) {
    return look(
        &(struct retention_config){.keep_days = days, .keep_bytes = bytes, .notice_s = notice_s});
}

static void what_is_too_old_goes_and_what_goes_next_is_told(void **state) {
    (void)state;
    struct retention_figures figures = keep(4, 0, 0);
    assert_string_equal(left(), "0 1 2");
    assert_int_equal(figures.removed, 3);
    assert_int_equal(figures.due, 1);
    assert_int_equal(figures.traces_bytes, 3000);
    struct store *store = open_records();
    const char *audit = rows_of(store, LIST_AUDIT, NULL);
    assert_non_null(strstr(audit, "actor=server|action=remove|subject=session "));
    store_close(&store);
}

static void what_has_no_room_goes_from_the_oldest_on(void **state) {
    (void)state;
    struct retention_figures figures = keep(0, 4000, 0);
    assert_string_equal(left(), "0 1 2 3");
    assert_int_equal(figures.due, 1);
}

static void after_a_start_it_only_tells(void **state) {
    (void)state;
    struct retention_figures figures = keep(4, 0, 3600);
    assert_string_equal(left(), "0 1 2 3 4 5");
    assert_int_equal(figures.removed, 0);
    assert_int_equal(figures.due, 4);
}

static void open_judged_and_unread_ones_stay(void **state) {
    (void)state;
    attempt_of(2, "practice");
    attempt_of(3, "practice");
    attempt_of(4, "exam");
    change("UPDATE session SET state = 'open' WHERE uuid LIKE '%1'");
    change("UPDATE session SET trace_xxh3 = NULL WHERE uuid LIKE '%2'");
    change("INSERT INTO rating (attempt_id, utc_ns, safety, field_of_view, camera_dexterity, "
           "instrument_dexterity, bimanual_dexterity, flow, quality, autonomy) SELECT id, 1, 3, 3, "
           "3, 3, 3, 3, 3, 2 FROM attempt WHERE session_id = (SELECT id FROM session WHERE uuid "
           "LIKE '%3')");
    change("UPDATE session SET end_utc_ns = end_utc_ns - 864000000000000 WHERE uuid NOT LIKE '%1'");
    keep(2, 0, 0);
    assert_string_equal(left(), "0 1 2 4");
}

static void one_of_another_server_or_of_several_parts_stays(void **state) {
    (void)state;
    change("UPDATE session SET server = 'b' WHERE uuid LIKE '%5'");
    change("UPDATE session SET part = 2 WHERE uuid LIKE '%6'");
    keep(2, 0, 0);
    assert_string_equal(left(), "0 4 5");
}

static void one_that_is_asked_for_stays(void **state) {
    (void)state;
    retention_asked(in_folder("traces/5.trace"));
    keep(2, 0, 0);
    assert_string_equal(left(), "0 5");
}

static void where_the_clock_makes_all_too_old_none_goes(void **state) {
    (void)state;
    struct retention_figures figures = keep(1, 0, 0);
    assert_string_equal(left(), "0 1 2 3 4 5");
    assert_int_equal(figures.due, 6);
}

static void one_that_was_recorded_without_a_true_time_stays(void **state) {
    (void)state;
    change("UPDATE session SET end_utc_ns = 1 WHERE uuid LIKE '%6'");
    keep(4, 0, 0);
    assert_string_equal(left(), "0 1 2 5");
}

static void where_the_traces_that_stay_have_all_the_room_none_goes(void **state) {
    (void)state;
    change("UPDATE session SET state = 'open' WHERE uuid NOT LIKE '%6'");
    keep(0, 4000, 0);
    assert_string_equal(left(), "0 1 2 3 4 5");
    keep(0, 5500, 0);
    assert_string_equal(left(), "0 1 2 3 4");
}

static bool never(void *user) {
    (void)user;
    return false;
}

static void while_other_servers_are_not_heard_none_goes(void **state) {
    (void)state;
    look(&(struct retention_config){.keep_days = 4, .may_remove = never});
    assert_string_equal(left(), "0 1 2 3 4 5");
}

static void without_bounds_nothing_goes(void **state) {
    (void)state;
    assert_null(retention_start(&(struct retention_config){store_path, in_folder("traces")}));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_is_too_old_goes_and_what_goes_next_is_told, begin,
                                        store_folder_end),
        cmocka_unit_test_setup_teardown(what_has_no_room_goes_from_the_oldest_on, begin,
                                        store_folder_end),
        cmocka_unit_test_setup_teardown(after_a_start_it_only_tells, begin, store_folder_end),
        cmocka_unit_test_setup_teardown(open_judged_and_unread_ones_stay, begin, store_folder_end),
        cmocka_unit_test_setup_teardown(one_of_another_server_or_of_several_parts_stays, begin,
                                        store_folder_end),
        cmocka_unit_test_setup_teardown(one_that_is_asked_for_stays, begin, store_folder_end),
        cmocka_unit_test_setup_teardown(where_the_clock_makes_all_too_old_none_goes, begin,
                                        store_folder_end),
        cmocka_unit_test_setup_teardown(one_that_was_recorded_without_a_true_time_stays, begin,
                                        store_folder_end),
        cmocka_unit_test_setup_teardown(where_the_traces_that_stay_have_all_the_room_none_goes,
                                        begin, store_folder_end),
        cmocka_unit_test_setup_teardown(while_other_servers_are_not_heard_none_goes, begin,
                                        store_folder_end),
        cmocka_unit_test_setup_teardown(without_bounds_nothing_goes, begin, store_folder_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
