#include "base/check.h"
#include "test.h"
#include "unit/trace_files.h"

#include <dirent.h>
#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static uint64_t steps_in(const char *from) {
    return read_prefix_of_steps(from).steps;
}

static void pause_ms(long ms) {
    nanosleep(&(struct timespec){ms / 1000, ms % 1000 * 1000000}, NULL);
}

static void a_killed_writer_leaves_all_that_was_written(void **state) {
    (void)state;
    unlink(path);
    pid_t writing = fork();
    if (writing == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        struct trace_writer *writer = start_writing();
        for (uint64_t n = 1; n < 30000; n++) {
            append_step(writer, n);
            pause_ms(1);
        }
        _exit(1);
    }
    uint64_t seen = 0;
    for (int i = 0; i < 1000 && seen < 200; i++) {
        pause_ms(10);
        seen = access(path, F_OK) == 0 ? steps_in(path) : 0;
    }
    kill(writing, SIGKILL);
    waitpid(writing, NULL, 0);
    assert_true(seen >= 200);
    struct outcome o = read_prefix_of_steps(path);
    assert_true(o.steps >= seen);
    assert_int_equal(o.end, RESULT_MISSING);
}

static void limit_file_size(rlim_t bytes) {
    struct rlimit limit;
    getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = bytes;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
}

// Appends steps until `refusals` were refused, and remembers which were taken.
#define STEPS_MAX 20000
static bool taken[STEPS_MAX + 1];

static uint64_t append_until_refused(struct trace_writer *writer, int refusals) {
    uint64_t n = 0;
    while (refusals > 0 && n < STEPS_MAX - 1000) {
        n++;
        taken[n] = append_step(writer, n);
        refusals -= !taken[n];
    }
    assert_int_equal(refusals, 0);
    return n;
}

// The file must hold the steps that were taken, and gaps for all others up to `last`.
static void assert_file_has_what_was_taken(uint64_t last) {
    struct trace_reader *reader = open_trace(path);
    struct trace_record record;
    uint64_t n = 0, missing = 0;
    while (trace_read(reader, &record, NULL) == RESULT_OK && record.type != TRACE_END) {
        if (record.type == TRACE_STEP) {
            assert_is_step(&record, ++n);
            assert_true(taken[n]);
            continue;
        }
        missing += record.missing;
        for (uint64_t i = 0; i < record.missing; i++)
            assert_false(taken[++n]);
    }
    assert_int_equal(n, last);
    assert_int_equal(record.type, TRACE_END);
    assert_int_equal(record.missing, missing);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_CLOSED);
    trace_reader_destroy(&reader);
}

static void a_full_disk_costs_counted_steps_and_the_rest_goes_on(void **state) {
    (void)state;
    struct trace_writer *writer = start_writing();
    limit_file_size(100000); // as a full disk: a write fails, and may stop within a record
    uint64_t n = append_until_refused(writer, 50);
    assert_int_equal(trace_writer_status(writer).missing, 50);
    assert_int_equal(trace_writer_status(writer).records, n - 50);
    limit_file_size(RLIM_INFINITY);
    uint64_t end = n + 900;
    while (n < end && !taken[n]) {
        pause_ms(10);
        n++;
        taken[n] = append_step(writer, n);
    }
    assert_true(taken[n]);
    trace_writer_destroy(&writer);
    assert_file_has_what_was_taken(n);
}

static void steps_missing_at_the_very_end_are_told(void **state) {
    (void)state;
    struct trace_writer *writer = start_writing();
    limit_file_size(100000);
    uint64_t n = append_until_refused(writer, 7);
    limit_file_size(RLIM_INFINITY);
    trace_writer_destroy(&writer);
    assert_file_has_what_was_taken(n);
}

static void a_disk_that_stays_full_loses_only_what_it_did_not_take(void **state) {
    (void)state;
    struct trace_writer *writer = start_writing();
    limit_file_size(100000);
    append_until_refused(writer, 1);
    trace_writer_destroy(&writer);
    limit_file_size(RLIM_INFINITY);
    struct outcome o = read_prefix_of_steps(path);
    assert_int_equal(o.end, RESULT_MISSING);
    assert_true(o.steps > 20);
}

static void *watch(void *context) {
    struct trace_writer *writer = context;
    uint64_t last = 0;
    for (int i = 0; i < 200; i++) {
        struct trace_status status = trace_writer_status(writer);
        CHECK(status.records >= last);
        last = status.records;
        pause_ms(1);
    }
    return NULL;
}

// Until the writer has put something more on disk: a busy machine must not fill its buffer.
static void wait_for_disk(const struct trace_writer *writer) {
    uint64_t before = trace_writer_status(writer).bytes;
    while (trace_writer_status(writer).bytes == before)
        pause_ms(1);
}

static void appending_writing_and_watching_go_on_at_once(void **state) {
    (void)state;
    struct trace_writer *writer = start_writing();
    pthread_t watcher;
    pthread_create(&watcher, NULL, watch, writer);
    for (uint64_t n = 1; n <= 20000; n++) {
        if (!append_step(writer, n))
            fail_msg("step %d was refused", (int)n);
        if (n % 300 == 0)
            wait_for_disk(writer);
    }
    pthread_join(watcher, NULL);
    trace_writer_destroy(&writer);
    struct outcome o = read_prefix_of_steps(path);
    assert_int_equal(o.end, RESULT_CLOSED);
    assert_int_equal(o.steps, 20000);
}

// ---- a disk that fails

static atomic_int syncs_to_fail, syncs_failed, sync_takes_ms;
static atomic_long synced_size;

int __real_fdatasync(int fd);
int __wrap_fdatasync(int fd);

// As a disk that fails: what was not on it yet is lost, and the system believes that it is clean.
int __wrap_fdatasync(int fd) {
    static const uint8_t nothing[1 << 16];
    pause_ms(atomic_load(&sync_takes_ms));
    if (atomic_load(&syncs_to_fail) <= 0) {
        long size = lseek(fd, 0, SEEK_END);
        if (__real_fdatasync(fd) == 0)
            atomic_store(&synced_size, size);
        return 0;
    }
    long end = lseek(fd, 0, SEEK_END);
    for (long at = atomic_load(&synced_size); at < end; at += (long)sizeof nothing) {
        size_t left = (size_t)(end - at);
        CHECK(pwrite(fd, nothing, left < sizeof nothing ? left : sizeof nothing, at) > 0);
    }
    atomic_fetch_sub(&syncs_to_fail, 1);
    atomic_fetch_add(&syncs_failed, 1);
    errno = EIO;
    return -1;
}

static uint64_t faults_told(void) {
    struct trace_reader *reader = open_trace(path);
    struct trace_record record;
    uint64_t faults = 0;
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        faults += record.type == TRACE_FAULT;
    trace_reader_destroy(&reader);
    return faults;
}

static void bytes_lost_by_a_failed_sync_are_rewritten_and_reported(void **state) {
    (void)state;
    atomic_store(&syncs_failed, 0);
    struct trace_writer *writer = start_writing();
    atomic_store(&synced_size, (long)trace_writer_status(writer).bytes);
    uint64_t n = 0;
    for (int round = 1; round <= 3; round++) {
        for (int i = 0; i < 200; i++)
            assert_true(append_step(writer, ++n));
        atomic_store(&syncs_to_fail, round == 2 ? 0 : round); // once, not at all, three times
        for (int i = 0; i < 100 && atomic_load(&syncs_to_fail) > 0; i++)
            pause_ms(50);
        assert_int_equal(atomic_load(&syncs_to_fail), 0);
        pause_ms(100);
    }
    assert_true(append_step(writer, ++n));
    trace_writer_destroy(&writer);
    struct outcome o = read_prefix_of_steps(path);
    assert_int_equal(o.end, RESULT_CLOSED);
    assert_int_equal(o.steps, n);
    assert_int_equal(atomic_load(&syncs_failed), 4);
    assert_in_range(faults_told(), 2, 4);
}

// A slow disk is always behind a session that goes on; it need not have caught up.
static void a_disk_that_works_again_is_told_while_steps_come(void **state) {
    (void)state;
    struct trace_writer *writer = start_writing();
    uint64_t n = 0;
    bool failed = false;
    atomic_store(&sync_takes_ms, 20);
    atomic_store(&syncs_to_fail, 1);
    for (int i = 0; i < 10000; i++) {
        assert_true(append_step(writer, ++n));
        pause_ms(1);
        bool failing = trace_writer_status(writer).failing;
        if (failed && !failing)
            break;
        failed = failed || failing;
    }
    assert_true(failed && !trace_writer_status(writer).failing);
    atomic_store(&sync_takes_ms, 0);
    trace_writer_destroy(&writer);
    assert_int_equal(steps_in(path), n);
}

static void a_sync_that_fails_at_the_end_is_tried_again(void **state) {
    (void)state;
    struct trace_writer *writer = start_writing();
    atomic_store(&synced_size, (long)trace_writer_status(writer).bytes);
    for (uint64_t n = 1; n <= 100; n++)
        assert_true(append_step(writer, n));
    atomic_store(&syncs_to_fail, 8); // almost a second
    trace_writer_destroy(&writer);
    struct outcome o = read_prefix_of_steps(path);
    assert_int_equal(o.end, RESULT_CLOSED);
    assert_int_equal(o.steps, 100);
    assert_int_equal(faults_told(), 1);
}

// ---- many writers

static int threads_now(void) {
    int count = 0;
    DIR *folder = opendir("/proc/self/task");
    while (readdir(folder))
        count++;
    closedir(folder);
    return count - 2;
}

static long resident_kb(void) {
    long pages = 0, unused;
    FILE *file = fopen("/proc/self/statm", "re");
    assert_int_equal(fscanf(file, "%ld %ld", &unused, &pages), 2);
    fclose(file);
    return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

static void many_writers_share_two_threads_and_touch_little_memory(void **state) {
    (void)state;
    enum { MANY = 64 };
    struct trace_writer *writers[MANY];
    char names[MANY][FOLDER_MAX + 32];
    struct trace_header header = some_header();
    int threads = threads_now();
    long before_kb = resident_kb();
    for (int i = 0; i < MANY; i++) {
        snprintf(names[i], sizeof names[i], "%s.%d", path, i);
        assert_int_equal(trace_writer_create(names[i], &header, NULL, NULL, &writers[i], NULL),
                         RESULT_OK);
    }
    for (uint64_t n = 1; n <= 50; n++)
        for (int i = 0; i < MANY; i++)
            assert_true(append_step(writers[i], n));
    assert_int_equal(threads_now(), threads + 2);
#ifdef __SANITIZE_THREAD__ // its own memory counts too
    (void)before_kb;
#else
    assert_true(resident_kb() - before_kb < MANY * 512);
#endif
    for (int i = 0; i < MANY; i++) {
        trace_writer_destroy(&writers[i]);
        assert_int_equal(steps_in(names[i]), 50);
        unlink(names[i]);
    }
    assert_int_equal(threads_now(), threads);
}

static atomic_uint_fast64_t written_before, written_end; // bytes of `path` below the end

ssize_t __real_pwrite(int fd, const void *bytes, size_t size, off_t at);
ssize_t __wrap_pwrite(int fd, const void *bytes, size_t size, off_t at);
ssize_t __wrap_pwrite(int fd, const void *bytes, size_t size, off_t at) {
    if ((uint64_t)at < atomic_load(&written_end))
        atomic_fetch_add(&written_before, size);
    return __real_pwrite(fd, bytes, size, at);
}

// The program may have ended after a failed fdatasync. Then pages that are not on disk count as
// clean, until they are written again.
static void what_may_not_be_on_disk_is_written_again_when_a_trace_goes_on(void **state) {
    (void)state;
    struct error err;
    struct trace_writer *writer = start_writing();
    for (uint64_t n = 1; n <= 50; n++)
        append_step(writer, n);
    trace_writer_leave(&writer);
    struct trace_reader *reader = open_trace(path);
    struct trace_record record;
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        continue;
    struct trace_place place = trace_reader_place(reader);
    trace_reader_destroy(&reader);
    atomic_store(&written_end, place.offset);
    if (trace_writer_resume(path, &place, 0, NULL, NULL, &writer, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    atomic_store(&written_end, 0);
    assert_int_equal(atomic_load(&written_before), place.offset);
    trace_writer_destroy(&writer);
    assert_int_equal(steps_in(path), 50);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_killed_writer_leaves_all_that_was_written),
        cmocka_unit_test(a_full_disk_costs_counted_steps_and_the_rest_goes_on),
        cmocka_unit_test(steps_missing_at_the_very_end_are_told),
        cmocka_unit_test(a_disk_that_stays_full_loses_only_what_it_did_not_take),
        cmocka_unit_test(appending_writing_and_watching_go_on_at_once),
        cmocka_unit_test(bytes_lost_by_a_failed_sync_are_rewritten_and_reported),
        cmocka_unit_test(a_disk_that_works_again_is_told_while_steps_come),
        cmocka_unit_test(a_sync_that_fails_at_the_end_is_tried_again),
        cmocka_unit_test(what_may_not_be_on_disk_is_written_again_when_a_trace_goes_on),
        cmocka_unit_test(many_writers_share_two_threads_and_touch_little_memory),
    };
    return cmocka_run_group_tests_name("trace_disk", tests, make_folder, remove_folder);
}
