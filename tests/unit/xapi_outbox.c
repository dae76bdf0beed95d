// The file of statements that wait: what is given, how far it was sent, and its bounds.

#include "folder.h"
#include "test.h"
#include "xapi/outbox.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char dir[FOLDER_MAX], path[FOLDER_MAX + 16];
static struct outbox *outbox;
static struct outbox_batch batch;
static struct error err;

static int begin(void **state) {
    (void)state;
    folder_make(dir);
    snprintf(path, sizeof path, "%s/out.jsonl", dir);
    batch.text = malloc(OUTBOX_BATCH_BYTES);
    assert_ok(outbox_open(path, true, &outbox, &err));
    return 0;
}

static int end(void **state) {
    (void)state;
    outbox_close(&outbox);
    free(batch.text);
    folder_remove(dir);
    return 0;
}

static void reopen(bool sends) {
    outbox_close(&outbox);
    assert_ok(outbox_open(path, sends, &outbox, &err));
}

static void add(const char *line) {
    assert_ok(outbox_add(outbox, line, &err));
}

static void append_raw(const char *text, off_t grown_to) {
    FILE *file = fopen(path, "a");
    assert_int_equal(ftruncate(fileno(file), grown_to), 0);
    fputs(text, file);
    fclose(file);
}

static void expect_next(int count, const char *first, const char *last) {
    assert_ok(outbox_next(outbox, &batch, &err));
    assert_int_equal(batch.count, count);
    if (count) {
        assert_string_equal(batch.text, first);
        assert_string_equal(batch.text + batch.starts[count - 1], last);
    }
}

static void lines_wait_until_they_are_sent_and_outlive_the_server(void **state) {
    (void)state;
    expect_next(0, NULL, NULL);
    add("{\"n\":1}");
    add("{\"n\":2}");
    add("{\"n\":3}");
    expect_next(3, "{\"n\":1}", "{\"n\":3}");
    assert_ok(outbox_sent(outbox, batch.starts[2], &err));
    expect_next(1, "{\"n\":3}", "{\"n\":3}");
    reopen(true);
    expect_next(1, "{\"n\":3}", "{\"n\":3}");
    assert_ok(outbox_sent(outbox, batch.starts[1], &err));
    expect_next(0, NULL, NULL);
}

static void a_batch_is_bounded(void **state) {
    (void)state;
    char text[16];
    for (int i = 0; i < OUTBOX_BATCH + 3; i++) {
        snprintf(text, sizeof text, "{\"n\":%d}", i);
        add(text);
    }
    snprintf(text, sizeof text, "{\"n\":%d}", OUTBOX_BATCH - 1);
    expect_next(OUTBOX_BATCH, "{\"n\":0}", text);
    assert_ok(outbox_sent(outbox, batch.starts[batch.count], &err));
    expect_next(3, "{\"n\":50}", "{\"n\":52}");
}

static void a_line_that_was_cut_off_gets_an_end(void **state) {
    (void)state;
    add("{}");
    append_raw("{\"id\":\"a", 3);
    reopen(true);
    add("{\"n\":2}");
    expect_next(3, "{}", "{\"n\":2}");
}

static void another_file_in_its_place_is_sent_whole(void **state) {
    (void)state;
    char moved[sizeof path + 8];
    add("{\"n\":1}");
    expect_next(1, "{\"n\":1}", "{\"n\":1}");
    assert_ok(outbox_sent(outbox, batch.starts[1], &err));
    outbox_close(&outbox);
    snprintf(moved, sizeof moved, "%s.moved", path);
    assert_int_equal(rename(path, moved), 0);
    append_raw("{\"n\":8}\n{\"n\":9}\n", 0);
    assert_ok(outbox_open(path, true, &outbox, &err));
    expect_next(2, "{\"n\":8}", "{\"n\":9}");
}

static void a_long_file_turns_over_once_all_is_sent(void **state) {
    (void)state;
    char before[sizeof path + 8];
    struct stat status;
    append_raw("\n", OUTBOX_TURN);
    reopen(false);
    add("{\"n\":1}");
    snprintf(before, sizeof before, "%s.1", path);
    assert_int_equal(stat(before, &status), 0);
    assert_int_equal(status.st_size, OUTBOX_TURN + 1);
    assert_int_equal(stat(path, &status), 0);
    assert_int_equal(status.st_size, 8);
    reopen(true);
    expect_next(1, "{\"n\":1}", "{\"n\":1}");
}

static void what_waits_is_never_thrown_away_but_bounded(void **state) {
    (void)state;
    append_raw("\n", OUTBOX_TURN);
    reopen(true);
    add("{\"n\":1}");
    append_raw("\n", OUTBOX_MOST - 8);
    reopen(true);
    assert_int_equal(outbox_add(outbox, "{\"n\":2}", &err), RESULT_LIMIT);
    assert_non_null(strstr(err.text, "256 MB wait"));
    assert_int_equal(outbox_next(outbox, &batch, &err), RESULT_FORMAT);
}

static void a_statement_without_bounds_is_refused(void **state) {
    (void)state;
    char *line = malloc(OUTBOX_LINE_MAX + 1);
    memset(line, 'x', OUTBOX_LINE_MAX);
    line[OUTBOX_LINE_MAX] = '\0';
    assert_int_equal(outbox_add(outbox, line, &err), RESULT_LIMIT);
    line[OUTBOX_LINE_MAX - 1] = '\0';
    add(line);
    expect_next(1, line, line);
    free(line);
}

static void where_it_cannot_be_the_error_names_the_file(void **state) {
    (void)state;
    struct outbox *none;
    assert_int_equal(outbox_open("/nowhere/out.jsonl", true, &none, &err), RESULT_IO);
    assert_null(none);
    assert_non_null(strstr(err.text, "/nowhere/out.jsonl"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(lines_wait_until_they_are_sent_and_outlive_the_server,
                                        begin, end),
        cmocka_unit_test_setup_teardown(a_batch_is_bounded, begin, end),
        cmocka_unit_test_setup_teardown(a_line_that_was_cut_off_gets_an_end, begin, end),
        cmocka_unit_test_setup_teardown(another_file_in_its_place_is_sent_whole, begin, end),
        cmocka_unit_test_setup_teardown(a_long_file_turns_over_once_all_is_sent, begin, end),
        cmocka_unit_test_setup_teardown(what_waits_is_never_thrown_away_but_bounded, begin, end),
        cmocka_unit_test_setup_teardown(a_statement_without_bounds_is_refused, begin, end),
        cmocka_unit_test_setup_teardown(where_it_cannot_be_the_error_names_the_file, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
