#include "test.h"
#include "trace/catalogue.h"
#include "unit/trace_files.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define PLACE_MAX (FOLDER_MAX + TRACE_NAME_MAX + 8)

static char folder[FOLDER_MAX];

static void put_part(const char *station, uint8_t first, uint16_t part, const char *rename_to,
                     char *out_path) {
    struct trace_header header = some_header();
    struct trace_writer *writer;
    char name[TRACE_NAME_MAX];
    snprintf(header.station, sizeof header.station, "%s", station);
    memset(header.session_id, 0xab, sizeof header.session_id);
    header.session_id[15] = first; // the first digits are the same
    header.part = part;
    trace_name(&header, name);
    snprintf(out_path, PLACE_MAX, "%s/%s", folder, rename_to ? rename_to : name);
    assert_int_equal(trace_writer_create(out_path, &header, NULL, NULL, &writer, NULL), RESULT_OK);
    trace_writer_destroy(&writer);
}

static void put_trace(const char *station, uint8_t first, const char *rename_to, char *out_path) {
    put_part(station, first, 1, rename_to, out_path);
}

static int count;
static struct trace_entry last;

static bool count_entry(void *user, const struct trace_entry *entry) {
    (void)user;
    last = *entry;
    return ++count < 2;
}

static int make(void **state) {
    (void)state;
    folder_make(folder);
    return 0;
}

static int drop(void **state) {
    (void)state;
    folder_remove(folder);
    return 0;
}

static void a_trace_is_found_by_its_whole_id(void **state) {
    (void)state;
    char one[PLACE_MAX], other[PLACE_MAX], found[PLACE_MAX];
    put_trace("room-1", 1, NULL, one);
    put_trace("room-2", 2, NULL, other);
    assert_int_equal(
        catalogue_find(folder, "abababababababababababababababab", found, sizeof found, NULL),
        RESULT_MISSING);
    assert_int_equal(
        catalogue_find(folder, "ababababababababababababababab02", found, sizeof found, NULL),
        RESULT_OK);
    assert_string_equal(found, other);
    assert_int_equal(catalogue_find(folder, "AB", found, sizeof found, NULL), RESULT_INVALID);
    assert_int_equal(
        catalogue_find("/nowhere", "ababababababababababababababab02", found, sizeof found, NULL),
        RESULT_IO);
}

static void a_name_says_station_and_start_and_others_are_passed_over(void **state) {
    (void)state;
    static const char *const others[] = {"room-1.trace", "-20260102T030405Z-01234567.trace.draft",
                                         "a-20260102T030405Z-0123456x.trace",
                                         "a-20260102T030405Z-01234567.csv",
                                         "20260102T030405Z-01234567.trace"};
    char file[PLACE_MAX];
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        put_trace("room-1", (uint8_t)i, others[i], file);
    count = 0;
    assert_int_equal(catalogue_each(folder, count_entry, NULL, NULL), RESULT_OK);
    assert_int_equal(count, 0);
    put_trace("bench-3-left", 7, NULL, file);
    assert_int_equal(catalogue_each(folder, count_entry, NULL, NULL), RESULT_OK);
    assert_int_equal(count, 1);
    assert_string_equal(last.station, "bench-3-left");
    assert_string_equal(last.stamp, "20260921T141320Z");
    assert_string_equal(last.id_start, "abababab");
    assert_true(last.written_utc_ns > some_header().start_utc_ns / 2);
}

static void one_that_cannot_be_read_is_found_by_its_name(void **state) {
    (void)state;
    char file[PLACE_MAX], found[PLACE_MAX];
    put_trace("room-1", 1, NULL, file);
    assert_int_equal(truncate(file, 20), 0);
    assert_int_equal(
        catalogue_find(folder, "ababababababababababababababab01", found, sizeof found, NULL),
        RESULT_OK);
    assert_string_equal(found, file);
}

static void of_several_parts_the_last_one_is_found(void **state) {
    (void)state;
    static const char *const others[] = {
        "a-20260102T030405Z-01234567-p1.trace",     "a-20260102T030405Z-01234567-p02.trace",
        "a-20260102T030405Z-01234567-p65536.trace", "a-20260102T030405Z-01234567-2.trace",
        "a-20260102T030405Z-01234567p2.trace",      "-p2.trace"};
    char one[PLACE_MAX], found[PLACE_MAX];
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        put_trace("a", (uint8_t)i, others[i], one);
    count = 0;
    assert_int_equal(catalogue_each(folder, count_entry, NULL, NULL), RESULT_OK);
    assert_int_equal(count, 0);
    put_part("room-p2", 9, 12, NULL, one);
    assert_int_equal(catalogue_each(folder, count_entry, NULL, NULL), RESULT_OK);
    assert_string_equal(last.station, "room-p2");
    assert_string_equal(one + strlen(folder) + 1, "room-p2-20260921T141320Z-abababab-p12.trace");
    assert_int_equal(last.part, 12);
    put_part("room-p2", 9, 1, NULL, found);
    put_part("room-p2", 9, 2, NULL, found);
    assert_int_equal(
        catalogue_find(folder, "ababababababababababababababab09", found, sizeof found, NULL),
        RESULT_OK);
    assert_string_equal(found, one);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, make, drop)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(a_trace_is_found_by_its_whole_id),
        TEST(a_name_says_station_and_start_and_others_are_passed_over),
        TEST(one_that_cannot_be_read_is_found_by_its_name),
        TEST(of_several_parts_the_last_one_is_found),
    };
    return cmocka_run_group_tests_name("trace_catalogue", tests, NULL, NULL);
}
