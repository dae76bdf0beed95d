// What the recorder makes of a trace that was closed as the server ends (a small one is read before
// it goes, a large one when it is back), of a session that begins meanwhile, of a trace that others
// wrote, and of records that are replaced.
#include "records/recorder.h"

#include "folder.h"
#include "net/authority.h"
#include "net/signer.h"
#include "test.h"
#include "unit/store_files.h"
#include "unit/trace_files.h"

#include <errno.h>
#include <libgen.h>
#include <pthread.h>
#include <sqlite3.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define LARGE_BYTES (64 << 20)

static char authority[FOLDER_MAX + 16]; // of the server

static const struct scene *no_scene(void *user, uint64_t case_hash) {
    (void)user, (void)case_hash;
    return NULL;
}

// At least so large; how many steps it has.
static uint64_t write_bytes_of_trace(uint64_t bytes) {
    static struct trace_record steps[64];
    struct trace_writer *writer = start_writing();
    struct error err;
    uint64_t count = 0;
    for (uint64_t i = 0; i < 64; i++) {
        steps[i].type = TRACE_STEP;
        step_at(i + 1, &steps[i].input, &steps[i].output);
    }
    while (!count || trace_writer_status(writer).bytes < bytes) {
        struct trace_record *next = &steps[count++ % 64];
        next->output.step = count;
        next->output.time_ns = next->input.time_ns = 5000000000 + (int64_t)count * 1000000;
        assert_int_equal(trace_append_record(writer, next, &err), RESULT_OK);
    }
    trace_writer_destroy(&writer);
    return count;
}

static struct recorder *start_with(scene_finder find) {
    char copy[sizeof path];
    const struct recorder_config config = {.records = store_path,
                                           .traces_dir = dirname(strcpy(copy, path)),
                                           .authority = authority,
                                           .find = find};
    return recorder_start(&config);
}

static struct recorder *start(void) {
    return start_with(no_scene);
}

static void *unlock_later(void *lock) {
    usleep(300000);
    assert_int_equal(sqlite3_close(lock), SQLITE_OK); // and with it what it had begun
    return NULL;
}

// Its session ends and the server with it, while somebody keeps the records locked.
static void end_with_the_server(void) {
    struct store_session session;
    struct trace_header header = some_header();
    sqlite3 *lock;
    pthread_t thread;
    assert_int_equal(sqlite3_open(store_path, &lock), SQLITE_OK);
    assert_int_equal(sqlite3_exec(lock, "BEGIN IMMEDIATE", NULL, NULL, NULL), SQLITE_OK);
    struct recorder *recorder = start();
    session_row_begin(&header, path, &session);
    session.state = STATE_CLOSED;
    session.end_utc_ns = session.start_utc_ns + 1;
    recorder_put(recorder, &session);
    assert_int_equal(pthread_create(&thread, NULL, unlock_later, lock), 0);
    recorder_stop(&recorder);
    pthread_join(thread, NULL);
}

static bool is_read(void) {
    struct store *store = open_records();
    bool done;
    struct error err;
    assert_int_equal(store_trace_is_done(store, path, &done, &err), RESULT_OK);
    store_close(&store);
    return done;
}

static void assert_recorded(uint64_t steps) {
    char said[64];
    struct store *store = open_records();
    const char *rows = rows_of(store, LIST_SESSIONS, NULL);
    snprintf(said, sizeof said, "|steps=%llu|", (unsigned long long)steps);
    assert_non_null(strstr(rows, said));
    assert_int_equal(row_count(store, LIST_SESSIONS), 1);
    store_close(&store);
}

static int begin(void **state) {
    int made = store_folder_begin(state);
    struct store *store = open_records();
    store_close(&store);
    return made + make_folder(state);
}

static int end(void **state) {
    return remove_folder(state) + store_folder_end(state);
}

static void a_small_one_is_read_before_the_server_is_gone(void **state) {
    (void)state;
    uint64_t steps = write_bytes_of_trace(1);
    end_with_the_server();
    assert_true(is_read());
    assert_recorded(steps);
}

static atomic_bool may_go_on;

static const struct scene *no_scene_for_long(void *user, uint64_t case_hash) {
    while (!atomic_load(&may_go_on))
        usleep(1000);
    return no_scene(user, case_hash);
}

static int rows_in_the_records(void) {
    struct store *store = open_records();
    int count = row_count(store, LIST_SESSIONS);
    store_close(&store);
    return count;
}

// The list of sessions has one that has begun, however long the traces of others take.
static void a_session_that_begins_is_there_while_a_trace_is_read(void **state) {
    (void)state;
    struct trace_header header = some_header();
    struct store_session ended, begun = a_session(2);
    write_bytes_of_trace(1);
    session_row_begin(&header, path, &ended);
    ended.state = STATE_CLOSED;
    ended.end_utc_ns = ended.start_utc_ns + 1;
    begun.state = STATE_OPEN;
    begun.end_utc_ns = 0;
    struct recorder *recorder = start_with(no_scene_for_long);
    recorder_put(recorder, &ended);
    recorder_put(recorder, &begun);
    for (int i = 0; i < 250 && rows_in_the_records() < 2; i++)
        usleep(20000);
    int rows = rows_in_the_records();
    bool read = is_read();
    atomic_store(&may_go_on, true);
    recorder_stop(&recorder);
    assert_int_equal(rows, 2);
    assert_false(read);
    assert_true(is_read());
}

static void a_large_one_is_read_when_the_server_is_back(void **state) {
    (void)state;
    struct stat status;
    uint64_t steps = write_bytes_of_trace(LARGE_BYTES);
    assert_int_equal(stat(path, &status), 0);
    assert_true(status.st_size >= LARGE_BYTES);
    end_with_the_server();
    assert_false(is_read());
    assert_recorded(0); // but that there was a session
    struct recorder *recorder = start();
    for (int i = 0; i < 600 && !is_read(); i++)
        usleep(50000);
    recorder_stop(&recorder);
    assert_true(is_read());
    assert_recorded(steps);
}

static void take_written(void *user, struct store *store, const char *session, int number) {
    int *numbers = user;
    assert_string_equal(session, a_session(1).id);
    assert_int_equal(row_count(store, LIST_ATTEMPTS), 1); // it is there already
    *numbers = 10 * *numbers + number;
}

static void who_waits_for_attempts_hears_of_those_that_were_written(void **state) {
    (void)state;
    int numbers = 0;
    char copy[sizeof path];
    const struct recorder_config config = {.records = store_path,
                                           .traces_dir = dirname(strcpy(copy, path)),
                                           .authority = authority,
                                           .find = no_scene,
                                           .attempt_written = take_written,
                                           .attempt_user = &numbers};
    const struct store_session session = a_session(1);
    struct attempt_row known = an_attempt(session.id, 7), unknown = an_attempt("no session", 8);
    struct recorder *recorder = recorder_start(&config);
    recorder_put(recorder, &session);
    recorder_attempt(recorder, &unknown);
    recorder_attempt(recorder, &known);
    recorder_attempt(recorder, &known); // as after a restart
    recorder_stop(&recorder);
    assert_int_equal(numbers, 7);
}

// As DELETE /sessions/ID does, while the recorder has still to write what it knows.
static void a_session_that_was_removed_meanwhile_stays_removed(void **state) {
    (void)state;
    struct trace_header header = some_header();
    struct store_session session;
    struct error err;
    sqlite3 *lock;
    write_bytes_of_trace(1);
    session_row_begin(&header, path, &session);
    session.state = STATE_INTERRUPTED;
    session.end_utc_ns = session.start_utc_ns + 1;
    struct store *store = open_records();
    assert_int_equal(store_put_session(store, &session, NULL, 0, &err), RESULT_OK);
    store_close(&store);
    assert_int_equal(sqlite3_open(store_path, &lock), SQLITE_OK);
    assert_int_equal(sqlite3_exec(lock, "BEGIN IMMEDIATE; DELETE FROM session", NULL, NULL, NULL),
                     SQLITE_OK);
    struct recorder *recorder = start();
    recorder_put(recorder, &session);
    unlink(path);
    assert_int_equal(sqlite3_exec(lock, "COMMIT", NULL, NULL, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_close(lock), SQLITE_OK);
    recorder_stop(&recorder);
    store = open_records();
    assert_int_equal(row_count(store, LIST_SESSIONS), 0);
    store_close(&store);
}

static void a_session_whose_trace_is_being_written_is_not_removed(void **state) {
    (void)state;
    struct trace_header header = some_header();
    struct store_session session;
    struct error err;
    struct trace_writer *writer = start_writing();
    session_row_begin(&header, path, &session);
    session.state = STATE_INTERRUPTED;
    struct store *store = open_records();
    assert_int_equal(store_put_session(store, &session, NULL, 0, &err), RESULT_OK);
    assert_int_equal(store_remove_session(store, session.id, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "is still being written"));
    assert_int_equal(access(path, F_OK), 0);
    assert_int_equal(row_count(store, LIST_SESSIONS), 1);
    trace_writer_destroy(&writer);
    assert_int_equal(store_remove_session(store, session.id, &err), RESULT_OK);
    assert_int_equal(row_count(store, LIST_SESSIONS), 0);
    assert_int_not_equal(access(path, F_OK), 0);
    store_close(&store);
}

// ---- whose traces
// ---------------------------------------------------------------------------------

static void make_keys(char keys[FOLDER_MAX]) {
    static const char *const hosts[] = {"localhost"};
    struct error err;
    folder_make(keys);
    folder_remove(keys); // the authority makes it
    assert_int_equal(authority_init(keys, hosts, 1, &err), RESULT_OK);
    snprintf(authority, sizeof authority, "%s/authority.pem", keys);
}

static void append_attempts(struct trace_writer *writer, uint32_t count) {
    for (uint32_t i = 1; i <= count; i++) {
        const struct trace_attempt begun = {.number = i,
                                            .task = "centring",
                                            .pass_time_s = 75,
                                            .size = 6,
                                            .text = "[task]"};
        const struct trace_outcome ended = {
            .number = i, .end = ATTEMPT_LEFT, .verdict = VERDICT_NOT_YET};
        assert_true(trace_append_begun(writer, &begun));
        assert_true(trace_append_ended(writer, &ended));
    }
}

// A server's keys, and a trace of five steps that it closed; none: nobody signed it.
static void write_with_attempts(const char *keys, uint32_t attempts) {
    struct signer *signer = NULL;
    struct trace_signer vouches = {0};
    struct trace_header header = some_header();
    struct trace_writer *writer;
    struct error err;
    header.start_utc_ns = (int64_t)time(NULL) * 1000000000;
    if (keys) {
        assert_int_equal(signer_create(keys, &signer, &err), RESULT_OK);
        vouches.sign = signer_sign;
        vouches.context = signer;
    }
    unlink(path);
    assert_int_equal(
        trace_writer_create(path, &header, keys ? &vouches : NULL, NULL, &writer, &err), RESULT_OK);
    for (uint64_t n = 1; n <= 5; n++)
        assert_true(append_step(writer, n));
    append_attempts(writer, attempts);
    trace_writer_destroy(&writer);
    signer_destroy(&signer);
}

static void write_signed(const char *keys) {
    write_with_attempts(keys, 0);
}

static int results_of_the_trace(void) {
    struct session_score score;
    struct error err;
    assert_int_equal(session_score_trace(path, authority, no_scene, NULL, &score, &err), RESULT_OK);
    assert_int_equal(score.session.steps, 5);
    assert_true(score.session.trace_is_read);
    int count = score.count;
    session_score_fini(&score);
    return count;
}

// So many calls later it fails; 0: never.
static int failing_fread;
size_t __real_fread(void *out, size_t size, size_t count, FILE *file);
size_t __wrap_fread(void *out, size_t size, size_t count, FILE *file);

size_t __wrap_fread(void *out, size_t size, size_t count, FILE *file) {
    if (!failing_fread || --failing_fread)
        return __real_fread(out, size, count, file);
    file->_flags |= 0x20; // ferror
    errno = EIO;
    return 0;
}

// It is read again at the next start, so it must not count as one that is damaged.
static void a_disk_that_fails_is_no_end_of_a_trace(void **state) {
    (void)state;
    struct session_score score;
    struct error err;
    int failed = 0, left;
    write_signed(NULL);
    do {
        failing_fread = failed + 1;
        enum result result =
            session_score_trace(path, "/nowhere.pem", no_scene, NULL, &score, &err);
        left = failing_fread;
        failing_fread = 0;
        assert_int_equal(result, left ? RESULT_OK : RESULT_IO);
        session_score_fini(&score);
        failed++;
    } while (!left);
    assert_true(failed > 10);
}

static void only_a_trace_that_this_server_signed_has_results(void **state) {
    (void)state;
    char keys[2][FOLDER_MAX];
    struct error err;
    make_keys(keys[1]);
    make_keys(keys[0]);
    write_signed(keys[0]);
    assert_true(results_of_the_trace() > 0);
    assert_int_equal(truncate(path, 4000), 0); // as a server that was killed leaves it
    struct session_score score;
    assert_int_equal(session_score_trace(path, authority, no_scene, NULL, &score, &err), RESULT_OK);
    assert_int_equal(score.count, 0);
    session_score_fini(&score);
    write_signed(keys[1]); // by themselves
    assert_int_equal(results_of_the_trace(), 0);
    write_signed(NULL);
    assert_int_equal(results_of_the_trace(), 0);
    folder_remove(keys[0]);
    folder_remove(keys[1]);
}

// ---- other records ------------------------------------------------------------------------------

static void wait_until_read(void) {
    for (int i = 0; i < 600 && !is_read(); i++)
        usleep(20000);
    assert_true(is_read());
}

static void write_over(const void *bytes, size_t size) {
    int lock;
    FILE *file = fopen(store_path, "r+b");
    assert_non_null(file);
    lock = fileno(file);
    assert_int_equal(ftruncate(lock, 0), 0);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    fclose(file);
}

// As a copy over the file does, or a file system that gives its number to the next file.
static void records_that_are_replaced_under_the_same_number_are_noticed(void **state) {
    (void)state;
    size_t size;
    struct stat before, after;
    uint64_t steps = write_bytes_of_trace(1);
    void *empty = get_file("records.db", &size);
    struct recorder *recorder = start();
    recorder_note(recorder, "grace", "open", "station room-1");
    wait_until_read();
    usleep(1500000); // it has looked at the file since
    assert_int_equal(stat(store_path, &before), 0);
    write_over(empty, size);
    assert_int_equal(stat(store_path, &after), 0);
    assert_int_equal(before.st_ino, after.st_ino);
    assert_false(is_read());
    wait_until_read();
    recorder_stop(&recorder);
    assert_recorded(steps);
    free(empty);
}

// It ended before the recorder looked at the traces again. Nothing else is written as they are
// replaced: an open connection would write its pages into the new file.
static void an_attempt_that_ends_as_records_are_replaced_is_kept(void **state) {
    (void)state;
    size_t size;
    struct store_session session = a_session(2);
    struct attempt_row attempt = an_attempt(session.id, 7);
    session.state = STATE_OPEN;
    session.end_utc_ns = 0;
    write_bytes_of_trace(1);
    void *empty = get_file("records.db", &size);
    struct recorder *recorder = start();
    wait_until_read(); // so what is open is written once
    recorder_put(recorder, &session);
    for (int i = 0; i < 250 && recorder_waiting(recorder); i++)
        usleep(20000);
    assert_int_equal(rows_in_the_records(), 2);
    write_over(empty, size);
    recorder_attempt(recorder, &attempt);
    recorder_stop(&recorder);
    struct store *store = open_records();
    assert_int_equal(row_count(store, LIST_ATTEMPTS), 1);
    store_close(&store);
    free(empty);
}

// ---- attempts of traces -------------------------------------------------------------------------

static int reads;

static void read_two(const char *trace, const struct scene *scene, attempt_row_taker take,
                     void *user) {
    struct store_session session;
    struct trace_header header = some_header();
    assert_string_equal(trace, path);
    assert_null(scene);
    session_row_begin(&header, trace, &session);
    for (int i = 1; i <= 2; i++) {
        const struct attempt_row row = an_attempt(session.id, i);
        take(user, &row);
    }
    reads++;
}

static int attempts_of_the_trace(const char *keys) {
    char copy[sizeof path];
    const struct recorder_config config = {.records = store_path,
                                           .traces_dir = dirname(strcpy(copy, path)),
                                           .authority = authority,
                                           .find = no_scene,
                                           .read_attempts = read_two};
    write_with_attempts(keys, 2);
    struct recorder *recorder = recorder_start(&config);
    for (int i = 0; i < 600 && !is_read(); i++)
        usleep(5000);
    assert_true(is_read());
    recorder_stop(&recorder);
    struct store *store = open_records();
    int count = row_count(store, LIST_ATTEMPTS);
    store_close(&store);
    return count;
}

static void attempts_of_a_trace_that_is_taken_over_get_their_rows(void **state) {
    (void)state;
    char keys[FOLDER_MAX];
    make_keys(keys);
    assert_int_equal(attempts_of_the_trace(NULL), 0); // anybody could have written it
    assert_int_equal(reads, 0);
    assert_true(sql_passes("records.db", "UPDATE session SET trace_xxh3 = NULL"));
    assert_int_equal(attempts_of_the_trace(keys), 2);
    assert_int_equal(reads, 1);
    assert_true(sql_passes("records.db", "UPDATE session SET trace_xxh3 = NULL"));
    assert_int_equal(attempts_of_the_trace(keys), 2);
    assert_int_equal(reads, 1); // the records have them
    folder_remove(keys);
}

// ---- the audit log ------------------------------------------------------------------------------

static int count_of(const char *rows, const char *text) {
    int count = 0;
    for (const char *at = rows; (at = strstr(at, text)); at++)
        count++;
    return count;
}

// Twice, since what was left once may be left again.
static void actions_while_the_records_were_locked_are_recorded_later(void **state) {
    (void)state;
    char arrears[sizeof store_path + 16];
    struct stat status;
    snprintf(arrears, sizeof arrears, "%s.arrears", store_path);
    for (int i = 0; i < 2; i++) {
        char subject[32];
        sqlite3 *lock;
        assert_int_equal(sqlite3_open(store_path, &lock), SQLITE_OK);
        assert_int_equal(sqlite3_exec(lock, "BEGIN IMMEDIATE", NULL, NULL, NULL), SQLITE_OK);
        struct recorder *recorder = start();
        snprintf(subject, sizeof subject, "station room-%d", i);
        recorder_note(recorder, "grace", "undo", subject);
        recorder_note(recorder, "", "end", subject);
        recorder_stop(&recorder);
        assert_int_equal(sqlite3_close(lock), SQLITE_OK);
        assert_int_equal(stat(arrears, &status), 0);
        assert_int_equal(status.st_mode & 0777, 0600);
    }
    FILE *file = fopen(arrears, "a");
    fputs("7\tnobody\n\xff\n", file);
    fclose(file);
    for (int i = 0; i < 2; i++) {
        struct recorder *recorder = start();
        recorder_stop(&recorder);
    }
    struct store *store = open_records();
    const char *rows = rows_of(store, LIST_AUDIT, NULL);
    const char *first = strstr(rows, "|actor=grace|action=undo|subject=station room-0\n");
    const char *last = strstr(rows, "|actor=server|action=end|subject=station room-1\n");
    assert_true(first && last);
    assert_true(first < last);
    assert_int_equal(count_of(rows, "action=undo"), 2);
    assert_int_equal(count_of(rows, "action=end"), 2);
    assert_int_equal(count_of(rows, "nobody"), 0);
    store_close(&store);
    assert_int_not_equal(stat(arrears, &status), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_small_one_is_read_before_the_server_is_gone, begin, end),
        cmocka_unit_test_setup_teardown(a_session_that_begins_is_there_while_a_trace_is_read, begin,
                                        end),
        cmocka_unit_test_setup_teardown(who_waits_for_attempts_hears_of_those_that_were_written,
                                        begin, end),
        cmocka_unit_test_setup_teardown(a_session_that_was_removed_meanwhile_stays_removed, begin,
                                        end),
        cmocka_unit_test_setup_teardown(a_session_whose_trace_is_being_written_is_not_removed,
                                        begin, end),
        cmocka_unit_test_setup_teardown(actions_while_the_records_were_locked_are_recorded_later,
                                        begin, end),
        cmocka_unit_test_setup_teardown(a_disk_that_fails_is_no_end_of_a_trace, begin, end),
        cmocka_unit_test_setup_teardown(only_a_trace_that_this_server_signed_has_results, begin,
                                        end),
        cmocka_unit_test_setup_teardown(records_that_are_replaced_under_the_same_number_are_noticed,
                                        begin, end),
        cmocka_unit_test_setup_teardown(an_attempt_that_ends_as_records_are_replaced_is_kept, begin,
                                        end),
        cmocka_unit_test_setup_teardown(attempts_of_a_trace_that_is_taken_over_get_their_rows,
                                        begin, end),
        cmocka_unit_test_setup_teardown(a_large_one_is_read_when_the_server_is_back, begin, end),
    };
    return cmocka_run_group_tests_name("recorder", tests, NULL, NULL);
}
