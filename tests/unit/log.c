// Lines of the log, and what becomes of too many of them.
#include "base/log.h"

#include "base/clock.h"
#include "folder.h"
#include "test.h"
#include "watch/log_journal.h"
#include "watch/log_json.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

int64_t __wrap_clock_now_ns(void);

static int64_t now_ns = 1000 * NS_PER_S;

int64_t __wrap_clock_now_ns(void) {
    return now_ns;
}

static char folder[FOLDER_MAX], path[FOLDER_MAX + 8];
static int kept_stderr;

static void begin(void) {
    folder_make(folder);
    snprintf(path, sizeof path, "%s/log", folder);
    fflush(stderr);
    kept_stderr = dup(STDERR_FILENO);
    assert_non_null(freopen(path, "w", stderr));
}

static void end(void) {
    fflush(stderr);
    dup2(kept_stderr, STDERR_FILENO);
    close(kept_stderr);
    folder_remove(folder);
}

// Lines that contain the text.
static int count_lines(const char *text) {
    char line[2048];
    int count = 0;
    fflush(stderr);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file))
        count += strstr(line, text) != NULL;
    fclose(file);
    return count;
}

static void
lines_of_one_kind_are_few_those_left_out_are_counted_and_others_are_whole(void **state) {
    (void)state;
    begin();
    for (int i = 0; i < 500; i++)
        log_info("a", "not limited %d", i);
    int whole = count_lines("not limited");
    log_limit_lines();
    for (int i = 0; i < 1000; i++)
        log_info("a", "flood %d", i);
    log_info("b", "another kind");
    int first = count_lines("a: flood"), other = count_lines("b: another kind");
    now_ns += 20 * NS_PER_S;
    log_info("b", "another kind");
    int told = count_lines("a: 800 lines were left out like \"flood %d\"");
    for (int i = 0; i < 1000; i++)
        log_info("a", "flood %d", i);
    int second = count_lines("a: flood");
    now_ns += 20 * NS_PER_S;
    log_info("b", "another kind");
    int told_again = count_lines("a: 900 lines were left out"), times = count_lines("left out");
    end();
    assert_int_equal(whole, 500);
    assert_int_equal(first, 200);
    assert_int_equal(other, 1);
    assert_int_equal(told, 1);
    assert_int_equal(second, 300); // 5 a second in 20 s
    assert_int_equal(told_again, 1);
    assert_int_equal(times, 2);
}

static void a_line_is_one_json_object_whatever_it_has(void **state) {
    (void)state;
    begin();
    log_as_json();
    log_warning("sessions", "station room-1: a \"quote\", a \\, a\nline");
    log_info("api", "caf\xc3\xa9");
    log_info("api", "caf\xc3\xa9, and a cut one: \xc3");
    fflush(stderr);
    int one = count_lines("\"level\":\"warning\",\"room\":\"sessions\",\"station\":\"room-1\","
                          "\"message\":\"station room-1: a \\\"quote\\\", a \\\\, a\\nline\"}\n");
    int other = count_lines("\"level\":\"info\",\"room\":\"api\",\"message\":\"caf\xc3\xa9\"}\n");
    int cut = count_lines("\"message\":\"caf??, and a cut one: ?\"}\n");
    end();
    assert_int_equal(one, 1);
    assert_int_equal(other, 1);
    assert_int_equal(cut, 1);
}

static char entry[2048]; // the fields of the newest entry of the journal, a line each
static int entries;

int __wrap_sd_journal_sendv(const struct iovec *fields, int count);

int __wrap_sd_journal_sendv(const struct iovec *fields, int count) {
    size_t used = 0;
    for (int i = 0; i < count; i++)
        used += (size_t)snprintf(entry + used, sizeof entry - used, "%.*s\n",
                                 (int)fields[i].iov_len, (char *)fields[i].iov_base);
    entries++;
    return 0;
}

// What systemd tells a service whose stderr it gave to the journal.
static void tell_stream(uintmax_t inode) {
    char stream[64];
    struct stat file;
    assert_int_equal(fstat(STDERR_FILENO, &file), 0);
    snprintf(stream, sizeof stream, "%" PRIuMAX ":%" PRIuMAX, (uintmax_t)file.st_dev,
             inode ? inode : (uintmax_t)file.st_ino);
    setenv("JOURNAL_STREAM", stream, 1);
}

static void a_service_writes_entries_of_the_journal_and_nobody_else_does(void **state) {
    (void)state;
    begin();
    unsetenv("JOURNAL_STREAM");
    log_to_journal();
    log_info("api", "by hand");
    tell_stream(1); // stderr is another file by now
    log_to_journal();
    log_info("api", "elsewhere");
    int before = entries;
    tell_stream(0);
    log_to_journal();
    log_warning("sessions", "station room-1: is late");
    end();
    assert_int_equal(before, 0);
    assert_int_equal(entries, 1);
    assert_string_equal(entry, "MESSAGE=sessions: station room-1: is late\nPRIORITY=4\n"
                               "ARTHRON_ROOM=sessions\nARTHRON_STATION=room-1\n");
    log_error("api", "nobody's");
    assert_string_equal(entry, "MESSAGE=api: nobody's\nPRIORITY=3\nARTHRON_ROOM=api\n");
    unsetenv("JOURNAL_STREAM");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_of_one_kind_are_few_those_left_out_are_counted_and_others_are_whole),
        cmocka_unit_test(a_line_is_one_json_object_whatever_it_has),
        cmocka_unit_test(a_service_writes_entries_of_the_journal_and_nobody_else_does),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
