#include "base/check.h"
#include "step/fields.h"
#include "test.h"
#include "unit/trace_files.h"
#include "unit/trace_mend.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static size_t slurp(uint8_t **out_data) {
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    struct stat status;
    fstat(fileno(file), &status);
    *out_data = alloc((size_t)status.st_size, 1);
    assert_int_equal(fread(*out_data, 1, (size_t)status.st_size, file), status.st_size);
    fclose(file);
    return (size_t)status.st_size;
}

static void write_copy(const uint8_t *data, size_t size) {
    unlink(copy_path); // a file that is made anew waits for no disk
    FILE *file = fopen(copy_path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    fclose(file);
}

static void steps_come_back_bit_for_bit(void **state) {
    (void)state;
    write_trace(1500);
    struct outcome o = read_prefix_of_steps(path);
    assert_int_equal(o.end, RESULT_CLOSED);
    assert_int_equal(o.steps, 1500);
}

static void the_end_record_counts_the_steps(void **state) {
    (void)state;
    write_trace(3);
    struct trace_reader *reader = open_trace(path);
    struct trace_record record;
    for (int i = 0; i < 4; i++)
        assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    assert_int_equal(record.type, TRACE_END);
    assert_int_equal(record.records, 3);
    assert_int_equal(record.missing, 0);
    assert_int_equal(record.offset + record.size, trace_reader_size(reader));
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_CLOSED);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_CLOSED);
    trace_reader_destroy(&reader);
}

static int64_t time_of_step(uint64_t n) {
    static struct session_input input;
    static struct session_output output;
    step_at(n, &input, &output);
    return input.time_ns;
}

static void the_last_time_is_found_from_the_end(void **state) {
    (void)state;
    static const uint64_t counts[] = {1, 3, 1500};
    int64_t time_ns;
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        write_trace(counts[i]);
        assert_int_equal(trace_last_time(path, &time_ns, NULL), RESULT_OK);
        assert_int_equal(time_ns, time_of_step(counts[i]));
    }
    uint8_t *data;
    size_t size = slurp(&data);
    assert_true(size > 200000);
    data[size - 60000] ^= 1; // what stands before the last records, and in them
    write_copy(data, size);
    assert_int_equal(trace_last_time(copy_path, &time_ns, NULL), RESULT_OK);
    assert_true(time_ns > 0 && time_ns <= time_of_step(1500));
    data[size - 60000] ^= 1;
    write_copy(data, size - 1000); // killed
    assert_int_equal(trace_last_time(copy_path, &time_ns, NULL), RESULT_OK);
    assert_true(time_ns > time_of_step(1400) && time_ns < time_of_step(1500));
    assert_int_equal(trace_last_time("nowhere", &time_ns, NULL), RESULT_IO);
    free(data);
    write_trace(0);
    assert_int_equal(trace_last_time(path, &time_ns, NULL), RESULT_MISSING);
}

static void a_trace_without_an_end_is_open(void **state) {
    (void)state;
    static const uint64_t counts[] = {0, 3, 1500};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        uint8_t *data;
        write_trace(counts[i]);
        assert_false(trace_is_open(path));
        size_t size = slurp(&data);
        write_copy(data, size - 1); // killed
        assert_true(trace_is_open(copy_path));
        free(data);
    }
    assert_false(trace_is_open("nowhere"));
}

static void an_existing_file_is_never_overwritten(void **state) {
    (void)state;
    write_trace(1);
    struct trace_header header = some_header();
    struct trace_writer *writer = NULL;
    struct error err = {""};
    assert_int_equal(trace_writer_create(path, &header, NULL, NULL, &writer, &err), RESULT_IO);
    assert_null(writer);
    assert_non_null(strstr(err.text, path));
}

static void the_machine_is_named(void **state) {
    (void)state;
    struct trace_header header = some_header();
    assert_int_equal(strlen(header.build), 40); // SHA-1 in hexadecimal
    assert_int_equal(strncmp(header.libc, "glibc 2.", 8), 0);
    assert_true(strlen(header.cpu) > 0);
}

static void every_truncation_reads_to_the_last_whole_record(void **state) {
    (void)state;
    write_trace(4);
    uint8_t *data;
    size_t size = slurp(&data), ends[8] = {0}, records = 0;
    struct trace_reader *reader = open_trace(path);
    size_t header_size = trace_reader_offset(reader);
    struct trace_record record;
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        ends[records++] = trace_reader_offset(reader);
    trace_reader_destroy(&reader);
    assert_int_equal(records, 5);
    for (size_t cut = 0; cut < size; cut++) {
        write_copy(data, cut);
        size_t whole = 0;
        while (whole < 4 && ends[whole] <= cut)
            whole++;
        struct outcome o = read_prefix_of_steps(copy_path);
        assert_int_equal(o.end, RESULT_MISSING);
        assert_int_equal(o.steps, whole);
        char byte[32];
        snprintf(byte, sizeof byte, "byte %zu:", whole ? ends[whole - 1] : header_size);
        if (cut >= header_size)
            assert_non_null(strstr(o.err.text, byte));
    }
    free(data);
}

// read_prefix_of_steps fails where a changed record is accepted.
static void a_flipped_bit_in_any_byte_is_noticed(void **state) {
    (void)state;
    write_trace(2);
    uint8_t *data;
    size_t size = slurp(&data);
    for (size_t i = 0; i < size; i++) {
        uint8_t bit = (uint8_t)(1u << (i % 8));
        data[i] ^= bit;
        write_copy(data, size);
        struct outcome o = read_prefix_of_steps(copy_path);
        assert_true(o.end != RESULT_CLOSED && o.end != RESULT_OK);
        data[i] ^= bit;
    }
    free(data);
}

static void bytes_after_the_end_record_are_noticed(void **state) {
    (void)state;
    write_trace(2);
    uint8_t *data;
    size_t size = slurp(&data);
    data = alloc_resize(data, size + 1, 1);
    data[size] = 0;
    write_copy(data, size + 1);
    assert_int_equal(read_prefix_of_steps(copy_path).end, RESULT_FORMAT);
    free(data);
}

static enum result end_of_copy(uint8_t *data, size_t size, bool mended) {
    if (mended)
        trace_mend(data, size);
    write_copy(data, size);
    return read_prefix_of_steps(copy_path).end;
}

static void a_record_left_out_repeated_or_forged_is_noticed(void **state) {
    (void)state;
    write_trace(3);
    uint8_t *data;
    size_t size = slurp(&data), at[5];
    struct trace_reader *reader = open_trace(path);
    struct trace_record record;
    for (int i = 0; i < 4; i++) {
        assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
        at[i] = record.offset;
    }
    at[4] = size;
    trace_reader_destroy(&reader);
    uint8_t *forged = alloc(2 * size, 1);
    memcpy(forged, data, at[1]); // the second step left out
    memcpy(forged + at[1], data + at[2], size - at[2]);
    assert_int_equal(end_of_copy(forged, size - (at[2] - at[1]), false), RESULT_CORRUPT);
    assert_int_equal(end_of_copy(forged, size - (at[2] - at[1]), true), RESULT_FORMAT);
    memcpy(forged, data, at[2]); // the second step twice
    memcpy(forged + at[2], data + at[1], size - at[1]);
    assert_int_equal(end_of_copy(forged, size + at[2] - at[1], false), RESULT_CORRUPT);
    assert_int_equal(end_of_copy(forged, size + at[2] - at[1], true), RESULT_FORMAT);
    memcpy(forged, data, at[1]); // the second and the third step changed places
    memcpy(forged + at[1], data + at[2], at[3] - at[2]);
    memcpy(forged + at[1] + at[3] - at[2], data + at[1], at[2] - at[1]);
    memcpy(forged + at[3], data + at[3], size - at[3]);
    assert_int_equal(end_of_copy(forged, size, false), RESULT_CORRUPT);
    assert_int_equal(end_of_copy(forged, size, true), RESULT_FORMAT);
    memcpy(forged, data, size); // an input of a kind that there is not
    forged[at[1] + 5] = INPUT_KIND_COUNT;
    assert_int_equal(end_of_copy(forged, size, true), RESULT_FORMAT);
    memcpy(forged, data, size); // time falls
    forged[at[2] + 5 + 1 + 7] = 0x80;
    assert_int_equal(end_of_copy(forged, size, true), RESULT_FORMAT);
    free(forged);
    free(data);
}

// Reads on behind all damage: whatever is accepted must be what was written. Sets in `out_read`
// which steps were.
static void read_behind_damage(bool *out_read, uint64_t *out_left_out) {
    struct trace_reader *reader = open_trace(copy_path);
    struct trace_record record;
    uint64_t bytes;
    *out_left_out = 0;
    do {
        while (trace_read(reader, &record, NULL) == RESULT_OK)
            if (record.type == TRACE_STEP) {
                assert_is_step(&record, record.output.step);
                out_read[record.output.step] = true;
            }
        bytes = 0;
        bool more = trace_skip_damage(reader, &bytes, NULL) == RESULT_OK;
        *out_left_out += more ? bytes : 0;
    } while (bytes);
    trace_reader_destroy(&reader);
}

static void one_damaged_record_leaves_all_others_readable(void **state) {
    (void)state;
    write_trace(6);
    uint8_t *data;
    size_t size = slurp(&data);
    struct trace_reader *reader = open_trace(path);
    struct trace_record record;
    while (trace_read(reader, &record, NULL) == RESULT_OK && record.output.step < 3)
        continue;
    trace_reader_destroy(&reader);
    for (size_t i = 0; i < record.size; i += 7) {
        bool was_read[7] = {0};
        uint64_t left_out;
        data[record.offset + i] ^= 0x10;
        write_copy(data, size);
        read_behind_damage(was_read, &left_out);
        data[record.offset + i] ^= 0x10;
        bool hash = i >= record.size - TRACE_HASH_SIZE; // then the next one has lost its past
        assert_true(was_read[1] && was_read[2] && was_read[5] && was_read[6]);
        assert_false(was_read[3]);
        assert_true(was_read[4] == !hash);
        assert_true(hash ? left_out > record.size : left_out == record.size);
    }
    free(data);
}

// Reads to the end, and tells where that is and whether it is torn.
static bool ends_torn(uint64_t *out_step) {
    struct trace_reader *reader = open_trace(copy_path);
    struct trace_record record;
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        *out_step = trace_reader_place(reader).step;
    bool torn = trace_ends_torn(reader);
    trace_reader_destroy(&reader);
    return torn;
}

// What a loss of power leaves: a page that never reached the disk, or only its beginning did.
static void lost_pages_are_the_end_of_a_trace_that_was_open(void **state) {
    (void)state;
    static uint8_t kept[4096];
    write_trace(40);
    uint8_t *data;
    uint64_t step = 0;
    size_t size = slurp(&data), open = size - 1000; // without its end record
    for (size_t page = 8192; page + 8192 < open; page += 4096)
        for (size_t from = 0; from < 3500; from += 700) {
            memcpy(kept, data + page, sizeof kept);
            memset(data + page + from, 0, sizeof kept - from);
            write_copy(data, open);
            assert_true(ends_torn(&step));
            assert_true(step >= 1 && step < 40);
            write_copy(data, size); // its end is there: that is damage
            assert_false(ends_torn(&step));
            memcpy(data + page, kept, sizeof kept);
        }
    write_copy(data, open);
    assert_false(ends_torn(&step)); // it only ends too early
    free(data);
}

static void a_changed_byte_is_no_torn_end(void **state) {
    (void)state;
    write_trace(9);
    uint8_t *data;
    uint64_t step;
    size_t open = slurp(&data) - 1000;
    for (size_t at = open / 2; at < open; at += 61) {
        data[at] ^= 1;
        write_copy(data, open);
        assert_false(ends_torn(&step));
        data[at] ^= 1;
    }
    free(data);
}

// A session's clock begins at 0 and never falls.
static void a_time_that_no_session_takes_is_refused(void **state) {
    (void)state;
    static const int64_t rows[][2] = {{-1, 7}, {7, 6}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct session_input input;
        struct session_output output;
        struct trace_writer *writer = start_writing();
        for (uint64_t n = 1; n <= 2; n++) {
            step_at(n, &input, &output);
            input.time_ns = output.time_ns = rows[i][n - 1];
            assert_true(trace_append(writer, &input, &output));
        }
        trace_writer_destroy(&writer);
        struct trace_reader *reader = open_trace(path);
        struct trace_record record;
        enum result result;
        while ((result = trace_read(reader, &record, NULL)) == RESULT_OK)
            continue;
        assert_int_equal(result, RESULT_FORMAT);
        trace_reader_destroy(&reader);
    }
}

static void a_header_that_is_not_ours_is_refused(void **state) {
    (void)state;
    write_trace(1);
    uint8_t *data;
    size_t size = slurp(&data);
    struct trace_reader *reader;
    static const struct {
        size_t at;
        uint8_t value;
        enum result expected;
    } rows[] = {
        {0, 'X', RESULT_FORMAT},                // magic
        {8, TRACE_VERSION + 1, RESULT_VERSION}, // a newer version
        {8, 1, RESULT_VERSION},                 // one that is too old
        {12, 1, RESULT_LIMIT},                  // larger than we accept
        {14, 1, RESULT_CORRUPT},                // a byte of the session's id
        {78, 99, RESULT_CORRUPT},               // length of a text
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        uint8_t before = data[rows[i].at];
        data[rows[i].at] = rows[i].value;
        write_copy(data, size);
        struct error err = {""};
        assert_int_equal(trace_reader_create(copy_path, &reader, &err), rows[i].expected);
        assert_non_null(strstr(err.text, copy_path));
        data[rows[i].at] = before;
    }
    data[78] = 99; // a text that is longer than its place, with a right checksum
    trace_mend(data, size);
    write_copy(data, size);
    assert_int_equal(trace_reader_create(copy_path, &reader, NULL), RESULT_FORMAT);
    free(data);
}

static void an_optic_that_none_is_is_refused(void **state) {
    (void)state;
    static const double bad[] = {-1, 0, 180, NAN, INFINITY};
    uint8_t *data;
    struct trace_reader *reader;
    write_trace(1);
    size_t size = slurp(&data);
    double field_deg = some_header().optic.field_deg;
    uint8_t *at = memmem(data, size, &field_deg, sizeof field_deg);
    assert_non_null(at);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        memcpy(at, &bad[i], sizeof bad[i]);
        trace_mend(data, size);
        write_copy(data, size);
        assert_int_equal(trace_reader_create(copy_path, &reader, NULL), RESULT_FORMAT);
    }
    free(data);
}

// Whatever single field of an output changes, exactly that field (and no other) is told.
static void every_byte_of_an_output_belongs_to_a_field(void **state) {
    (void)state;
    static struct step_field fields[STEP_FIELDS_MAX];
    int count = step_fields(fields);
    struct session_input input;
    struct session_output before, after;
    step_at(1, &input, &before);
    size_t told = 0;
    for (size_t i = 0; i < sizeof before; i++) {
        after = before;
        ((uint8_t *)&after)[i] ^= 1;
        int different = 0;
        for (int k = 0; k < count; k++)
            different += !step_field_equal(&fields[k], &before, &after);
        assert_true(different <= 1);
        told += (size_t)different;
    }
    // The rest is padding, after enums and counts of the output, in each instrument and in the
    // moves, the blade of all moves but the first, and the numbers of described instruments and of
    // loose bodies.
    assert_int_equal(sizeof before - told, 4 + 4 + 8 + INSTRUMENT_COUNT * (3 + 4 + 4 + 4 + 4) + 4 +
                                               8 + 4 * (2 * JOB_MOVES_MAX - 1));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(steps_come_back_bit_for_bit),
        cmocka_unit_test(the_end_record_counts_the_steps),
        cmocka_unit_test(the_last_time_is_found_from_the_end),
        cmocka_unit_test(a_trace_without_an_end_is_open),
        cmocka_unit_test(an_existing_file_is_never_overwritten),
        cmocka_unit_test(the_machine_is_named),
        cmocka_unit_test(every_truncation_reads_to_the_last_whole_record),
        cmocka_unit_test(a_flipped_bit_in_any_byte_is_noticed),
        cmocka_unit_test(bytes_after_the_end_record_are_noticed),
        cmocka_unit_test(a_record_left_out_repeated_or_forged_is_noticed),
        cmocka_unit_test(one_damaged_record_leaves_all_others_readable),
        cmocka_unit_test(lost_pages_are_the_end_of_a_trace_that_was_open),
        cmocka_unit_test(a_changed_byte_is_no_torn_end),
        cmocka_unit_test(a_time_that_no_session_takes_is_refused),
        cmocka_unit_test(a_header_that_is_not_ours_is_refused),
        cmocka_unit_test(an_optic_that_none_is_is_refused),
        cmocka_unit_test(every_byte_of_an_output_belongs_to_a_field),
    };
    return cmocka_run_group_tests_name("trace", tests, make_folder, remove_folder);
}
