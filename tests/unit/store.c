// The records: what is put in comes out, through versions, copies and restores.
#include "test.h"
#include "unit/store_files.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static struct error err;

static const struct store_result figures[] = {
    {"resection.over", "meniscus_medial", 1, "mm3", 12.5, "{\"cuts\":3}"},
    {"resection.rim", "meniscus_medial", 1, "mm", NAN, ""},
};

static void close_session(struct store_session *s) {
    s->state = STATE_CLOSED;
    s->end_utc_ns = s->start_utc_ns + 90000000000LL;
    s->steps = 18000;
    s->trace_is_read = true;
    s->trace_xxh3 = 0xfeedface;
    memset(s->trace_hash, 'a', 64);
}

// ---- rows ---------------------------------------------------------------------------------------

static void a_session_is_kept_from_its_begin_to_its_end(void **state) {
    (void)state;
    struct store *store = open_records();
    struct store_session session = a_session(1);
    bool done;
    assert_ok(store_put_session(store, &session, NULL, 0, &err));
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, NULL),
                           "|start_utc_ns=1001000000000|end_utc_ns=|state=open|steps=0|missing=0|"
                           "trace=/traces/1.trace|trace_xxh3=|trace_hash=|part=1|server=\n"));
    assert_ok(store_trace_is_done(store, session.trace, &done, &err));
    assert_false(done);
    close_session(&session);
    assert_ok(store_put_session(store, &session, figures, 2, &err));
    assert_string_equal(rows_of(store, LIST_SESSIONS, session.id),
                        "id=00000000000000000000000000000001|station=room-1|trainee=ada|"
                        "case=tear-radial|case_hash=000000001234abcd|start_utc_ns=1001000000000|"
                        "end_utc_ns=1091000000000|state=closed|steps=18000|missing=0|"
                        "trace=/traces/1.trace|trace_xxh3=00000000feedface|trace_hash="
                        "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa|part=1|"
                        "server=\n");
    assert_string_equal(
        rows_of(store, LIST_RESULTS, session.id),
        "session=00000000000000000000000000000001|metric=resection.over|subject=meniscus_medial|"
        "version=1|unit=mm3|value=12.5|details={\"cuts\":3}\n"
        "session=00000000000000000000000000000001|metric=resection.rim|subject=meniscus_medial|"
        "version=1|unit=mm|value=|details=\n");
    assert_ok(store_trace_is_done(store, session.trace, &done, &err));
    assert_true(done);
    assert_string_equal(rows_of(store, LIST_SESSIONS, "nobody"), "");
    store_close(&store);
}

static void a_metric_of_a_new_version_stands_beside_the_old(void **state) {
    (void)state;
    struct store *store = open_records();
    struct store_session session = a_session(1);
    struct store_result result = figures[0];
    assert_ok(store_put_session(store, &session, &result, 1, &err));
    result.value = 13;
    assert_ok(store_put_session(store, &session, &result, 1, &err));
    assert_int_equal(row_count(store, LIST_RESULTS), 1);
    result.version = 2;
    assert_ok(store_put_session(store, &session, &result, 1, &err));
    assert_int_equal(row_count(store, LIST_RESULTS), 2);
    store_close(&store);
}

static void a_session_with_a_bad_result_leaves_nothing(void **state) {
    (void)state;
    struct store *store = open_records();
    struct store_session session = a_session(1);
    struct store_result results[2] = {figures[0], figures[1]};
    results[1].version = 0;
    assert_int_equal(store_put_session(store, &session, results, 2, &err), RESULT_INVALID);
    assert_int_equal(row_count(store, LIST_SESSIONS), 0);
    assert_int_equal(row_count(store, LIST_RESULTS), 0);
    assert_int_equal(row_count(store, LIST_TRAINEES), 0);
    store_close(&store);
}

static void sessions_of_a_server_that_ended_are_interrupted(void **state) {
    (void)state;
    struct store *store = open_records();
    struct store_session old = a_session(1), closed = a_session(2), newer = a_session(5);
    close_session(&closed);
    assert_ok(store_put_session(store, &old, NULL, 0, &err));
    assert_ok(store_put_session(store, &closed, NULL, 0, &err));
    assert_ok(store_put_session(store, &newer, NULL, 0, &err));
    assert_ok(store_interrupt_open(store, newer.start_utc_ns, &err));
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, old.id), "state=interrupted"));
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, closed.id), "state=closed"));
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, newer.id), "state=open"));
    store_close(&store);
}

static void people_courses_and_accounts_are_kept(void **state) {
    (void)state;
    struct store *store = open_records();
    assert_ok(store_add_trainee(store, "ada", "Ada Lovelace", &err));
    assert_ok(store_add_trainee(store, "björn", NULL, &err));
    assert_ok(store_add_course(store, "autumn", &err));
    assert_ok(store_enrol(store, "ada", "autumn", &err));
    assert_ok(store_enrol(store, "ada", "autumn", &err));
    assert_ok(store_add_account(store, "ada", ROLE_TRAINEE, "$argon2id$v=19$m=65536$c2FsdA$aGFzaA",
                                "ada", &err));
    assert_ok(store_add_account(store, "eve", ROLE_INSTRUCTOR, NULL, NULL, &err));
    assert_string_equal(rows_of(store, LIST_ENROLMENTS, NULL), "course=autumn|trainee=ada\n");
    assert_non_null(strstr(rows_of(store, LIST_TRAINEES, NULL), "name=björn|full_name=|"));
    assert_non_null(strstr(rows_of(store, LIST_ACCOUNTS, "ada"),
                           "name=ada|role=trainee|trainee=ada|can_log_in=1|"));
    assert_non_null(strstr(rows_of(store, LIST_ACCOUNTS, "eve"),
                           "name=eve|role=instructor|trainee=|can_log_in=0|"));
    const char *audit = rows_of(store, LIST_AUDIT, NULL);
    assert_non_null(strstr(audit, "actor=tester|action=add|subject=trainee 1\n"));
    assert_null(strstr(audit, "ada"));
    assert_int_equal(store_add_trainee(store, "ada", NULL, &err), RESULT_REFUSED);
    assert_int_equal(store_enrol(store, "ada", "spring", &err), RESULT_MISSING);
    assert_int_equal(store_add_account(store, "x", ROLE_TRAINEE, NULL, "nobody", &err),
                     RESULT_MISSING);
    assert_int_equal(store_add_account(store, "x", ROLE_TRAINEE, "secret", NULL, &err),
                     RESULT_INVALID);
    static const char *const of_others[] = {"server", "trainee 7", "account 12"};
    for (size_t i = 0; i < sizeof of_others / sizeof *of_others; i++) {
        assert_int_equal(store_add_account(store, of_others[i], ROLE_TECHNICIAN, NULL, NULL, &err),
                         RESULT_INVALID);
        assert_int_equal(store_rename_account(store, "eve", of_others[i], &err), RESULT_INVALID);
    }
    store_close(&store);
}

static void names_that_cannot_be_kept_are_refused(void **state) {
    (void)state;
    static const char *const bad[] = {
        "",
        "a\nb",
        "a\x7f",
        "\x80",
        "\xc0\xaf",
        "\xe2\x82",
        "\xed\xa0\x80",
        "\xf4\x90\x80\x80",
        "\xff",
        "a\xc2\x85", // a control character of two bytes
        "0123456789012345678901234567890123456789012345678901234567890123",
    };
    struct store *store = open_records();
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(store_add_trainee(store, bad[i], NULL, &err), RESULT_INVALID);
        assert_int_equal(store_add_course(store, bad[i], &err), RESULT_INVALID);
        struct store_session session = a_session(1);
        snprintf(session.station, sizeof session.station, "%.63s", bad[i]);
        if (strlen(bad[i]) < sizeof session.station)
            assert_int_equal(store_put_session(store, &session, NULL, 0, &err), RESULT_INVALID);
    }
    assert_ok(store_add_trainee(store, "Þóra 山 𝒳 '; DROP TABLE trainee; --", NULL, &err));
    assert_int_equal(row_count(store, LIST_TRAINEES), 1);
    store_close(&store);
}

static void the_audit_log_only_grows(void **state) {
    (void)state;
    struct store *store = open_records();
    assert_ok(store_add_course(store, "autumn", &err));
    store_close(&store);
    assert_false(sql_passes("records.db", "DELETE FROM audit"));
    assert_false(sql_passes("records.db", "UPDATE audit SET actor = 'nobody'"));
    assert_true(sql_passes("records.db", "DELETE FROM course"));
}

// ---- erasing ------------------------------------------------------------------------------------

static void an_erased_trainee_leaves_results_and_no_trace_in_the_files(void **state) {
    (void)state;
    struct store *store = open_records();
    struct store_session session = a_session(1);
    char pseudonym[STORE_NAME_MAX];
    strcpy(session.trainee, "lovelace-1815");
    assert_ok(store_add_trainee(store, "lovelace-1815", "Augusta Ada Byron-King", &err));
    assert_ok(store_add_course(store, "autumn", &err));
    assert_ok(store_enrol(store, "lovelace-1815", "autumn", &err));
    assert_ok(store_add_account(store, "lovelace-login", ROLE_TRAINEE, "$argon2id$AdaSecret",
                                "lovelace-1815", &err));
    assert_ok(store_put_session(store, &session, figures, 2, &err));
    assert_ok(store_erase_trainee(store, "lovelace-1815", pseudonym, &err));
    assert_int_equal(strncmp(pseudonym, "erased-", 7), 0);
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, session.id), pseudonym));
    assert_int_equal(row_count(store, LIST_RESULTS), 2);
    assert_int_equal(row_count(store, LIST_ENROLMENTS), 0);
    assert_int_equal(row_count(store, LIST_ACCOUNTS), 0);
    assert_non_null(strstr(rows_of(store, LIST_AUDIT, NULL), "action=erase|subject=trainee 1\n"));
    for (int closed = 0; closed < 2; closed++) {
        static const char *const files[] = {"records.db", "records.db-wal"};
        static const char *const words[] = {"lovelace", "Augusta", "AdaSecret"};
        for (int i = 0; i < 2; i++)
            for (int k = 0; k < 3; k++)
                assert_false(file_has(files[i], words[k]));
        store_close(&store); // a second time does nothing
    }
    store = open_records();
    assert_int_equal(store_erase_trainee(store, "lovelace-1815", pseudonym, &err), RESULT_MISSING);
    // What comes later of the session does not bring the name back.
    close_session(&session);
    assert_ok(store_put_session(store, &session, NULL, 0, &err));
    assert_int_equal(row_count(store, LIST_TRAINEES), 1);
    store_close(&store);
    assert_false(file_has("records.db", "lovelace"));
}

// ---- several at once ----------------------------------------------------------------------------

#define WRITERS 3
#define WRITES 40

static void *write_sessions(void *argument) {
    unsigned writer = *(unsigned *)argument;
    for (unsigned i = 0; i < WRITES; i++) {
        struct store *store;
        struct store_session session = a_session(1000 * writer + i);
        if (store_open(store_path, STORE_MAKE, "writer", &store, NULL) != RESULT_OK ||
            store_put_session(store, &session, NULL, 0, NULL) != RESULT_OK)
            return "failed";
        store_close(&store);
    }
    return NULL;
}

static void several_writers_lose_nothing_and_a_backup_among_them_is_whole(void **state) {
    (void)state;
    pthread_t threads[WRITERS];
    unsigned numbers[WRITERS];
    struct store *store = open_records();
    for (unsigned i = 0; i < WRITERS; i++) {
        numbers[i] = i + 1;
        assert_int_equal(pthread_create(&threads[i], NULL, write_sessions, &numbers[i]), 0);
    }
    for (int i = 0; i < 5; i++) {
        char name[32], aside[STORE_TEXT_MAX];
        snprintf(name, sizeof name, "backup-%d.db", i);
        assert_ok(store_backup(store, in_folder(name), &err));
        assert_ok(store_restore(in_folder(name), in_folder("other.db"), "tester", aside, &err));
    }
    for (int i = 0; i < WRITERS; i++) {
        void *failed;
        pthread_join(threads[i], &failed);
        assert_null(failed);
    }
    assert_int_equal(row_count(store, LIST_SESSIONS), WRITERS * WRITES);
    assert_int_equal(row_count(store, LIST_STATIONS), 1);
    store_close(&store);
}

// ---- copies -------------------------------------------------------------------------------------

static void a_restore_brings_the_backup_back_and_keeps_the_replaced_file(void **state) {
    (void)state;
    char aside[STORE_TEXT_MAX];
    struct stat status;
    struct store *store = open_records();
    assert_ok(store_add_course(store, "autumn", &err));
    assert_ok(store_backup(store, in_folder("backup.db"), &err));
    assert_int_equal(store_backup(store, in_folder("backup.db"), &err), RESULT_REFUSED);
    assert_int_equal(stat(in_folder("backup.db"), &status), 0);
    assert_int_equal(status.st_mode & 0777, 0600);
    assert_int_not_equal(access(in_folder("backup.db-wal"), F_OK), 0);
    assert_int_not_equal(access(in_folder("backup.db.part"), F_OK), 0);
    assert_ok(store_add_course(store, "winter", &err));
    store_close(&store);

    assert_ok(store_restore(in_folder("backup.db"), store_path, "tester", aside, &err));
    store = open_records();
    assert_int_equal(row_count(store, LIST_COURSES), 1);
    assert_non_null(strstr(rows_of(store, LIST_AUDIT, NULL), "action=restore|subject=records\n"));
    store_close(&store);
    assert_ok(store_open(aside, STORE_THERE, "tester", &store, &err));
    assert_int_equal(row_count(store, LIST_COURSES), 2);
    store_close(&store);
}

static void a_restore_by_root_keeps_the_owner(void **state) {
    (void)state;
    const uid_t server = geteuid() == 0 ? 65534 : geteuid();
    char aside[STORE_TEXT_MAX];
    struct stat status;
    struct store *store = open_records();
    assert_ok(store_backup(store, in_folder("backup.db"), &err));
    store_close(&store);
    assert_int_equal(chown(store_path, server, (gid_t)-1), 0);
    assert_ok(store_restore(in_folder("backup.db"), store_path, "tester", aside, &err));
    assert_int_equal(stat(store_path, &status), 0);
    assert_int_equal(status.st_uid, server);
}

static void a_restore_waits_for_those_who_have_the_records_open(void **state) {
    (void)state;
    char aside[STORE_TEXT_MAX];
    struct store *store = open_records();
    assert_ok(store_backup(store, in_folder("backup.db"), &err));
    assert_int_equal(store_restore(in_folder("backup.db"), store_path, "tester", aside, &err),
                     RESULT_TIMEOUT);
    assert_non_null(strstr(err.text, store_path));
    assert_ok(store_add_course(store, "autumn", &err));
    store_close(&store);
    assert_ok(store_restore(in_folder("backup.db"), store_path, "tester", aside, &err));
}

static void damaged_records_are_put_aside_as_they_are(void **state) {
    (void)state;
    char aside[STORE_TEXT_MAX];
    struct store *store = open_records();
    assert_ok(store_add_course(store, "autumn", &err));
    assert_ok(store_backup(store, in_folder("backup.db"), &err));
    store_close(&store);
    put_file("records.db", "rubbish", 7);
    assert_ok(store_restore(in_folder("backup.db"), store_path, "tester", aside, &err));
    store = open_records();
    assert_int_equal(row_count(store, LIST_COURSES), 1);
    store_close(&store);
    assert_true(file_has(strrchr(aside, '/') + 1, "rubbish"));
}

// SQLite would play the log of the damaged file into the one that takes its place.
static void the_log_of_damaged_records_goes_aside_with_them(void **state) {
    (void)state;
    char aside[STORE_TEXT_MAX];
    size_t size;
    struct store *store = open_records();
    assert_ok(store_backup(store, in_folder("backup.db"), &err));
    store_close(&store);
    store = open_records(); // with a log that lacks the file's first page
    assert_ok(store_add_course(store, "autumn", &err));
    void *log = get_file("records.db-wal", &size);
    assert_true(size > 0);
    store_close(&store);
    put_file("records.db", "rubbish", 7);
    put_file("records.db-wal", log, size);
    free(log);
    assert_ok(store_restore(in_folder("backup.db"), store_path, "tester", aside, &err));
    store = open_records();
    assert_int_equal(row_count(store, LIST_COURSES), 0);
    store_close(&store);
    assert_int_equal(access(strcat(aside, "-wal"), F_OK), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, store_folder_begin, store_folder_end)
        TEST(a_session_is_kept_from_its_begin_to_its_end),
        TEST(a_metric_of_a_new_version_stands_beside_the_old),
        TEST(a_session_with_a_bad_result_leaves_nothing),
        TEST(sessions_of_a_server_that_ended_are_interrupted),
        TEST(people_courses_and_accounts_are_kept),
        TEST(names_that_cannot_be_kept_are_refused),
        TEST(the_audit_log_only_grows),
        TEST(an_erased_trainee_leaves_results_and_no_trace_in_the_files),
        TEST(several_writers_lose_nothing_and_a_backup_among_them_is_whole),
        TEST(a_restore_brings_the_backup_back_and_keeps_the_replaced_file),
        TEST(a_restore_by_root_keeps_the_owner),
        TEST(a_restore_waits_for_those_who_have_the_records_open),
        TEST(damaged_records_are_put_aside_as_they_are),
        TEST(the_log_of_damaged_records_goes_aside_with_them),
    };
    return cmocka_run_group_tests_name("store", tests, NULL, NULL);
}
