// Records that are locked, damaged, cut short or something else: a clear error, or what is left.
#include "test.h"
#include "unit/store_files.h"

#include <pthread.h>
#include <signal.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

static struct error err;

static void take_nothing(void *user, const struct store_cell *cells, int count) {
    (void)user, (void)cells, (void)count;
}

// ---- what is no file of ours --------------------------------------------------------------------

static const struct {
    const char *what;
    const char *text, *sql; // the file's bytes, or what makes it
    enum result expected;
    const char *says;
} files[] = {
    {"text", "[server]\nkeys = keys\nrecords = records.db\n", NULL, RESULT_FORMAT,
     "not a database"},
    {"a header alone", "SQLite format 3", NULL, RESULT_FORMAT, "not a database"},
    {"another program's", NULL, "CREATE TABLE song (title TEXT)", RESULT_FORMAT,
     "does not hold records"},
    {"another program's, empty", NULL, "PRAGMA application_id = 77", RESULT_FORMAT,
     "does not hold records"},
    {"a version without an owner", NULL, "PRAGMA user_version = 1", RESULT_FORMAT,
     "does not hold records"},
    {"ours without a version", NULL, "PRAGMA application_id = 0x4172746e", RESULT_FORMAT,
     "version 0"},
    {"below all versions", NULL,
     "PRAGMA application_id = 0x4172746e; PRAGMA user_version = -3; CREATE TABLE t (n)",
     RESULT_FORMAT, "version -3"},
    {"of the year 3000", NULL,
     "PRAGMA application_id = 0x4172746e; PRAGMA user_version = 2147483647", RESULT_VERSION,
     "newer"},
};

static void a_file_without_records_is_named_and_left_alone(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        struct store *store;
        size_t size, size_after;
        char aside[STORE_TEXT_MAX];
        unlink(store_path);
        if (files[i].text)
            put_file("records.db", files[i].text, strlen(files[i].text));
        else
            assert_true(sql_passes("records.db", files[i].sql));
        void *before = get_file("records.db", &size);
        assert_int_equal(store_open(store_path, STORE_MAKE, "tester", &store, &err),
                         files[i].expected);
        assert_null(store);
        assert_non_null(strstr(err.text, store_path));
        if (!strstr(err.text, files[i].says))
            fail_msg("%s: %s", files[i].what, err.text);
        assert_int_equal(store_restore(store_path, in_folder("o.db"), "tester", aside, &err),
                         files[i].expected);
        if (files[i].expected == RESULT_FORMAT && !strstr(err.text, "is not a backup"))
            fail_msg("%s: %s", files[i].what, err.text);
        assert_int_not_equal(access(in_folder("o.db"), F_OK), 0);
        void *after = get_file("records.db", &size_after);
        assert_int_equal(size, size_after);
        assert_memory_equal(before, after, size);
        free(before);
        free(after);
    }
}

static void *make_records_soon(void *unused) {
    struct store *store;
    usleep(200000);
    assert_int_equal(store_open(store_path, STORE_MAKE, "server", &store, NULL), RESULT_OK);
    store_close(&store);
    return unused;
}

// As that of a server that has just been started.
static void a_file_that_is_just_being_made_is_waited_for(void **state) {
    (void)state;
    struct store *store;
    pthread_t server;
    unlink(store_path);
    put_file("records.db", "", 0);
    assert_int_equal(pthread_create(&server, NULL, make_records_soon, NULL), 0);
    assert_int_equal(store_open(store_path, STORE_THERE, "tester", &store, &err), RESULT_OK);
    store_close(&store);
    pthread_join(server, NULL);
}

static void records_that_are_not_there_are_made_only_where_asked(void **state) {
    (void)state;
    struct store *store;
    char aside[STORE_TEXT_MAX];
    assert_int_equal(store_open(store_path, STORE_THERE, "tester", &store, &err), RESULT_MISSING);
    assert_int_not_equal(access(store_path, F_OK), 0);
    assert_int_equal(store_open(in_folder("no/such/folder.db"), STORE_MAKE, "tester", &store, &err),
                     RESULT_IO);
    assert_int_equal(mkdir(in_folder("folder"), 0700), 0);
    assert_int_equal(store_open(in_folder("folder"), STORE_MAKE, "tester", &store, &err),
                     RESULT_IO);
    assert_int_equal(store_restore(in_folder("none.db"), store_path, "tester", aside, &err),
                     RESULT_MISSING);
    umask(0);
    store = open_records();
    struct stat status;
    assert_int_equal(stat(store_path, &status), 0);
    assert_int_equal(status.st_mode & 0777, 0600);
    store_close(&store);
}

// ---- locked, full -------------------------------------------------------------------------------

static void records_that_are_locked_can_be_read_and_tried_again(void **state) {
    (void)state;
    sqlite3 *other;
    struct store *store = open_records();
    struct store_session session = a_session(1);
    assert_int_equal(store_put_session(store, &session, NULL, 0, &err), RESULT_OK);
    assert_int_equal(sqlite3_open(store_path, &other), SQLITE_OK);
    assert_int_equal(sqlite3_exec(other, "BEGIN EXCLUSIVE", NULL, NULL, NULL), SQLITE_OK);
    session = a_session(2);
    assert_int_equal(store_put_session(store, &session, NULL, 0, &err), RESULT_TIMEOUT);
    assert_non_null(strstr(err.text, store_path));
    assert_non_null(strstr(err.text, "locked"));
    assert_int_equal(row_count(store, LIST_SESSIONS), 1);
    assert_int_equal(sqlite3_exec(other, "ROLLBACK", NULL, NULL, NULL), SQLITE_OK);
    sqlite3_close(other);
    assert_int_equal(store_put_session(store, &session, NULL, 0, &err), RESULT_OK);
    assert_int_equal(row_count(store, LIST_SESSIONS), 2);
    store_close(&store);
}

static void a_full_disk_is_told_and_takes_no_part_of_a_row(void **state) {
    (void)state;
    struct rlimit limit, tight;
    struct store *store = open_records();
    struct store_session session = a_session(1);
    enum result result = RESULT_OK;
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &limit);
    tight = limit;
    tight.rlim_cur = 200000; // of the log beside the file
    setrlimit(RLIMIT_FSIZE, &tight);
    unsigned put = 0;
    while (put < 500 && result == RESULT_OK) {
        session = a_session(++put);
        result = store_put_session(store, &session, NULL, 0, &err);
    }
    setrlimit(RLIMIT_FSIZE, &limit);
    assert_int_equal(result, RESULT_IO);
    assert_non_null(strstr(err.text, store_path));
    assert_int_equal(row_count(store, LIST_SESSIONS), put - 1);
    assert_int_equal(store_put_session(store, &session, NULL, 0, &err), RESULT_OK);
    assert_int_equal(row_count(store, LIST_SESSIONS), put);
    store_close(&store);
}

static void a_backup_without_space_names_the_file_that_has_none(void **state) {
    (void)state;
    struct rlimit limit, tight;
    struct store *store = open_records();
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &limit);
    tight = limit;
    tight.rlim_cur = 20000;
    setrlimit(RLIMIT_FSIZE, &tight);
    enum result result = store_backup(store, in_folder("copy.db"), &err);
    setrlimit(RLIMIT_FSIZE, &limit);
    store_close(&store);
    assert_int_equal(result, RESULT_IO);
    assert_non_null(strstr(err.text, in_folder("copy.db:")));
    assert_null(strstr(err.text, "records.db"));
    assert_int_not_equal(access(in_folder("copy.db"), F_OK), 0);
    assert_int_not_equal(access(in_folder("copy.db.part"), F_OK), 0);
}

// ---- damaged ------------------------------------------------------------------------------------

static void make_good_file(void) {
    struct store *store = open_records();
    struct store_result result = {"over", "meniscus_medial", 1, "mm3", 4.5, ""};
    assert_int_equal(store_add_trainee(store, "ada", "Ada Lovelace", &err), RESULT_OK);
    for (unsigned i = 1; i <= 60; i++) {
        struct store_session session = a_session(i);
        assert_int_equal(store_put_session(store, &session, &result, 1, &err), RESULT_OK);
    }
    store_close(&store);
}

static bool is_told(enum result result) {
    return result == RESULT_OK || strstr(err.text, store_dir) != NULL;
}

// All that can be asked of a file. Never a crash; a failure names the file; a backup that is made
// is whole.
static bool use(const char *name) {
    struct store *store;
    struct store_session session = a_session(99);
    char pseudonym[STORE_NAME_MAX];
    unlink(in_folder("backup.db"));
    enum result result = store_open(in_folder(name), STORE_MAKE, "tester", &store, &err);
    if (result != RESULT_OK) {
        assert_true(is_told(result));
        return false;
    }
    bool all = true;
    for (int i = 0; i < LIST_COUNT; i++) {
        result = store_rows(store, (enum store_list)i, NULL, take_nothing, NULL, &err);
        assert_true(is_told(result));
        all = all && result == RESULT_OK;
    }
    result = store_backup(store, in_folder("backup.db"), &err);
    assert_true(is_told(result));
    assert_int_equal(result == RESULT_OK, access(in_folder("backup.db"), F_OK) == 0);
    assert_int_not_equal(access(in_folder("backup.db.part"), F_OK), 0);
    all = all && result == RESULT_OK;
    assert_true(is_told(store_put_session(store, &session, NULL, 0, &err)));
    assert_true(is_told(store_erase_trainee(store, "ada", pseudonym, &err)));
    store_close(&store);
    return all;
}

static void remove_log(const char *name) {
    char log[64];
    for (int i = 0; i < 2; i++) {
        snprintf(log, sizeof log, i ? "%s-shm" : "%s-wal", name);
        unlink(in_folder(log));
    }
}

static void a_file_that_was_cut_short_is_told(void **state) {
    (void)state;
    size_t size;
    make_good_file();
    char *good = get_file("records.db", &size);
    int whole = 0;
    for (size_t left = 0; left < size; left += size / 24) {
        put_file("cut.db", good, left);
        remove_log("cut.db");
        whole += use("cut.db");
    }
    free(good);
    assert_int_equal(whole, 1); // an empty file is a new one
}

static void rows_that_refer_to_nothing_are_found_by_a_backup(void **state) {
    (void)state;
    char aside[STORE_TEXT_MAX];
    make_good_file();
    assert_true(sql_passes("records.db", "PRAGMA foreign_keys = OFF;"
                                         "UPDATE session SET trainee_id = 77 WHERE id = 3"));
    struct store *store = open_records();
    assert_int_equal(store_backup(store, in_folder("backup.db"), &err), RESULT_CORRUPT);
    assert_non_null(strstr(err.text, store_path));
    assert_int_not_equal(access(in_folder("backup.db"), F_OK), 0);
    store_close(&store);
    assert_int_equal(store_restore(store_path, in_folder("other.db"), "tester", aside, &err),
                     RESULT_CORRUPT);
    assert_int_not_equal(access(in_folder("other.db"), F_OK), 0);
}

static void flipped_bits_never_harm_the_program(void **state) {
    (void)state;
    size_t size;
    uint64_t chance = 88172645463325252u;
    int found = 0;
    make_good_file();
    uint8_t *good = get_file("records.db", &size);
    for (int i = 0; i < 150; i++) {
        for (int k = 0; k < 4; k++) { // of them many in the first pages
            chance ^= chance << 13, chance ^= chance >> 7, chance ^= chance << 17;
            size_t range = i % 3 ? size : 200;
            good[(chance >> 20) % range] ^= (uint8_t)(1u << (chance & 7));
        }
        put_file("bad.db", good, size);
        remove_log("bad.db");
        found += !use("bad.db");
        if (i % 5 == 4) {
            free(good);
            good = get_file("records.db", &size);
        }
    }
    free(good);
    assert_in_range(found, 30, 150);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, store_folder_begin, store_folder_end)
        TEST(a_file_without_records_is_named_and_left_alone),
        TEST(a_file_that_is_just_being_made_is_waited_for),
        TEST(records_that_are_not_there_are_made_only_where_asked),
        TEST(records_that_are_locked_can_be_read_and_tried_again),
        TEST(a_full_disk_is_told_and_takes_no_part_of_a_row),
        TEST(a_backup_without_space_names_the_file_that_has_none),
        TEST(a_file_that_was_cut_short_is_told),
        TEST(rows_that_refer_to_nothing_are_found_by_a_backup),
        TEST(flipped_bits_never_harm_the_program),
    };
    return cmocka_run_group_tests_name("store_bad", tests, NULL, NULL);
}
