// Remarks in a trace: beside the steps, and no step.
#include "base/clock.h"
#include "test.h"
#include "trace/record.h"
#include "unit/trace_files.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

#define STEPS 5

static struct remark some_remark(uint32_t number) {
    struct remark remark = {.number = number,
                            .time_ns = 7 * NS_PER_S,
                            .author = "Dr. Müller",
                            .text = "Lift the hand",
                            .has_marker = true,
                            .body = BODY_TIBIA,
                            .point = {1.5, -2, 3}};
    return remark;
}

static void assert_is_remark(const struct remark *remark, const struct remark *expected) {
    assert_int_equal(remark->number, expected->number);
    assert_int_equal(remark->time_ns, expected->time_ns);
    assert_string_equal(remark->author, expected->author);
    assert_string_equal(remark->text, expected->text);
    assert_int_equal(remark->withdrawn, expected->withdrawn);
    assert_int_equal(remark->has_marker, expected->has_marker);
    assert_int_equal(remark->body, expected->body);
    assert_memory_equal(&remark->point, &expected->point, sizeof remark->point);
}

static void write_with_remarks(void) {
    struct trace_writer *writer = start_writing();
    for (uint32_t i = 1; i <= STEPS; i++) {
        struct remark remark = some_remark(i);
        assert_true(append_step(writer, i));
        assert_true(trace_append_remark(writer, &remark));
    }
    trace_writer_destroy(&writer);
}

static void remarks_come_back_where_they_were_made(void **state) {
    (void)state;
    struct trace_record record;
    write_with_remarks();
    struct trace_reader *reader = open_trace(path);
    for (uint32_t i = 1; i <= STEPS; i++) {
        struct remark expected = some_remark(i);
        assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
        assert_is_step(&record, i);
        assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
        assert_int_equal(record.type, TRACE_REMARK);
        assert_is_remark(&record.remark, &expected);
    }
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    assert_int_equal(record.type, TRACE_END);
    assert_int_equal(record.records, STEPS);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_CLOSED);
    trace_reader_destroy(&reader);
}

static void a_piece_keeps_its_remarks(void **state) {
    (void)state;
    struct trace_record record;
    struct trace_writer *writer;
    write_with_remarks();
    struct trace_reader *reader = open_trace(path);
    assert_int_equal(
        trace_writer_create(copy_path, trace_reader_header(reader), NULL, NULL, &writer, NULL),
        RESULT_OK);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        assert_int_equal(trace_append_record(writer, &record, NULL), RESULT_OK);
    trace_writer_destroy(&writer);
    trace_reader_destroy(&reader);
    reader = open_trace(copy_path);
    int remarks = 0;
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        remarks += record.type == TRACE_REMARK;
    assert_int_equal(remarks, STEPS);
    trace_reader_destroy(&reader);
    unlink(copy_path);
}

static void invalid_remarks_are_refused(void **state) {
    (void)state;
    const struct remark good = some_remark(1);
    struct remark bad[] = {good, good, good, good, good, good};
    bad[0].number = 0;
    bad[1].number = REMARKS_MAX + 1;
    bad[2].body = BODY_COUNT;
    bad[3].point.y = NAN;
    bad[4].point.z = 10001;
    bad[5].text[0] = '\0', bad[5].has_marker = false;
    assert_true(remark_is_valid(&good));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_false(remark_is_valid(&bad[i]));
    bad[5].withdrawn = true; // that is said of one that had a marker alone
    assert_true(remark_is_valid(&bad[5]));
}

// The version before has none: its reader must not meet one, and ours takes none for it.
static void an_older_trace_has_no_remarks(void **state) {
    (void)state;
    struct remark remark = some_remark(1);
    uint8_t data[RECORD_MAX];
    struct chain chain;
    struct error err;
    size_t rest;
    chain_init(&chain);
    size_t size = record_encode_remark(&remark, &chain, data);
    assert_int_equal(record_decode_prefix(data, 4, &rest, &err), RESULT_OK);
    assert_int_equal(rest, size - RECORD_PREFIX);
    assert_int_equal(record_decode_prefix(data, 3, &rest, &err), RESULT_FORMAT);
    chain_fini(&chain);
}

// Right in its checksum, wrong in what it says.
static void a_remark_that_is_cut_short_is_refused(void **state) {
    (void)state;
    struct remark remark = some_remark(1);
    uint8_t data[RECORD_MAX];
    static struct trace_record record;
    struct trace_end end;
    for (int field = 0; field < 2; field++) {
        struct chain chain;
        chain_init(&chain);
        size_t size = record_encode_remark(&remark, &chain, data);
        size_t at = field ? RECORD_PREFIX : size - TRACE_HASH_SIZE - 25; // number; body
        data[at] = field ? 0 : BODY_COUNT;
        chain_fini(&chain);
        chain_init(&chain);
        chain_add(&chain, data, size - TRACE_HASH_SIZE);
        memcpy(data + size - TRACE_HASH_SIZE, chain.value, TRACE_HASH_SIZE);
        chain_fini(&chain);
        chain_init(&chain);
        struct trace_layout layout = {TRACE_VERSION, RULES_NEWEST};
        assert_int_equal(record_decode(data, size, layout, &chain, &record, &end, NULL),
                         RESULT_FORMAT);
        chain_fini(&chain);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(remarks_come_back_where_they_were_made),
        cmocka_unit_test(a_piece_keeps_its_remarks),
        cmocka_unit_test(invalid_remarks_are_refused),
        cmocka_unit_test(an_older_trace_has_no_remarks),
        cmocka_unit_test(a_remark_that_is_cut_short_is_refused),
    };
    return cmocka_run_group_tests_name("trace_remarks", tests, make_folder, remove_folder);
}
