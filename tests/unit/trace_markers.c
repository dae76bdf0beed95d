// Markers in a trace: beside the steps, with times of their own.
#include "base/clock.h"
#include "test.h"
#include "trace/player.h"
#include "trace/record.h"
#include "unit/trace_files.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

#define STEPS 5

static struct marker some_marker(uint64_t number) {
    struct marker marker = {.run = 0xfedcba9876543210,
                            .number = number,
                            .time_ns = 7 * NS_PER_S - (int64_t)number, // each before the last
                            .value = -2.5,
                            .name = "trial.start",
                            .device = "Gerät 1"};
    return marker;
}

static void assert_is_marker(const struct marker *marker, const struct marker *expected) {
    assert_int_equal(marker->run, expected->run);
    assert_int_equal(marker->number, expected->number);
    assert_int_equal(marker->time_ns, expected->time_ns);
    assert_true(marker->value == expected->value);
    assert_string_equal(marker->name, expected->name);
    assert_string_equal(marker->device, expected->device);
}

static void write_with_markers(void) {
    struct trace_writer *writer = start_writing();
    for (uint32_t i = 1; i <= STEPS; i++) {
        struct marker marker = some_marker(i);
        assert_true(append_step(writer, i));
        assert_true(trace_append_marker(writer, &marker));
    }
    trace_writer_destroy(&writer);
}

static void a_marker_comes_back_where_it_came_with_its_own_time(void **state) {
    (void)state;
    struct trace_record record;
    write_with_markers();
    struct trace_reader *reader = open_trace(path);
    for (uint32_t i = 1; i <= STEPS; i++) {
        struct marker expected = some_marker(i);
        assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
        assert_is_step(&record, i);
        assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
        assert_int_equal(record.type, TRACE_MARKER);
        assert_is_marker(&record.marker, &expected);
    }
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    assert_int_equal(record.type, TRACE_END);
    assert_int_equal(record.records, STEPS);
    trace_reader_destroy(&reader);
}

static bool count(void *user, const struct marker *marker) {
    struct marker expected = some_marker(++*(uint64_t *)user);
    assert_is_marker(marker, &expected);
    return true;
}

static void a_copy_of_the_records_keeps_markers(void **state) {
    (void)state;
    struct trace_record record;
    struct trace_writer *writer;
    uint64_t markers = 0;
    struct trace_player player = {.user = &markers, .marker = count};
    write_with_markers();
    struct trace_reader *reader = open_trace(path);
    assert_int_equal(
        trace_writer_create(copy_path, trace_reader_header(reader), NULL, NULL, &writer, NULL),
        RESULT_OK);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        assert_int_equal(trace_append_record(writer, &record, NULL), RESULT_OK);
    trace_writer_destroy(&writer);
    trace_reader_destroy(&reader);
    reader = open_trace(copy_path);
    assert_int_equal(trace_play(reader, &player, NULL), RESULT_CLOSED);
    assert_int_equal(markers, STEPS);
    trace_reader_destroy(&reader);
    unlink(copy_path);
}

// Who acknowledges a marker must know that it is there for good.
static void what_is_on_disk_is_told_after_it_was_written_and_no_sooner(void **state) {
    (void)state;
    struct trace_writer *writer = start_writing();
    struct marker marker = some_marker(1);
    uint64_t before = trace_position(writer);
    assert_true(trace_takes_markers(writer));
    assert_true(trace_is_on_disk(writer, before));
    assert_true(trace_append_marker(writer, &marker));
    assert_true(trace_position(writer) > before);
    int64_t until_ns = clock_now_ns() + 60 * NS_PER_S;
    while (!trace_is_on_disk(writer, trace_position(writer)) && clock_now_ns() < until_ns)
        usleep(1000);
    assert_true(trace_is_on_disk(writer, trace_position(writer)));
    assert_true(trace_writer_status(writer).bytes > before);
    assert_false(trace_is_on_disk(writer, trace_position(writer) + 1));
    trace_writer_destroy(&writer);
}

static void invalid_markers_are_refused(void **state) {
    (void)state;
    const struct marker good = some_marker(1);
    struct marker bad[] = {good, good, good, good, good, good, good};
    bad[0].number = 0;
    bad[1].value = NAN;
    bad[2].name[0] = '\0';
    strcpy(bad[3].name, "two words");
    memset(bad[4].name, 'a', sizeof bad[4].name);
    strcpy(bad[5].device, "two\nlines");
    bad[6].device[0] = '\0';
    assert_true(marker_is_valid(&good));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_false(marker_is_valid(&bad[i]));
}

// Right in its checksum, wrong in what it says.
static void a_marker_that_says_nonsense_is_refused(void **state) {
    (void)state;
    static struct trace_record record;
    const struct marker good = some_marker(1);
    struct marker bad[] = {good, good, good, good};
    bad[1].time_ns = INT64_MAX;
    bad[2].value = INFINITY;
    bad[3].name[0] = ' ';
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        uint8_t data[RECORD_MAX];
        struct trace_end end;
        struct chain chain;
        struct trace_layout layout = {TRACE_VERSION, RULES_NEWEST};
        chain_init(&chain);
        size_t size = record_encode_marker(&bad[i], &chain, data);
        chain_fini(&chain);
        chain_init(&chain);
        assert_int_equal(record_decode(data, size, layout, &chain, &record, &end, NULL),
                         i ? RESULT_FORMAT : RESULT_OK);
        chain_fini(&chain);
    }
}

static void an_older_trace_has_no_markers(void **state) {
    (void)state;
    struct marker marker = some_marker(1);
    uint8_t data[RECORD_MAX];
    struct error err;
    size_t rest, size = record_encode_marker(&marker, NULL, data);
    assert_int_equal(record_decode_prefix(data, 5, &rest, &err), RESULT_OK);
    assert_int_equal(rest, size - RECORD_PREFIX);
    assert_int_equal(record_decode_prefix(data, 4, &rest, &err), RESULT_FORMAT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_marker_comes_back_where_it_came_with_its_own_time),
        cmocka_unit_test(a_copy_of_the_records_keeps_markers),
        cmocka_unit_test(what_is_on_disk_is_told_after_it_was_written_and_no_sooner),
        cmocka_unit_test(invalid_markers_are_refused),
        cmocka_unit_test(a_marker_that_says_nonsense_is_refused),
        cmocka_unit_test(an_older_trace_has_no_markers),
    };
    return cmocka_run_group_tests_name("trace_markers", tests, make_folder, remove_folder);
}
