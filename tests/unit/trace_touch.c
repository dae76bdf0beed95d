// Touched surfaces in traces: their bytes, their records, and what is wrong with them.
#include "base/check.h"
#include "random.h"
#include "test.h"
#include "trace/record.h"
#include "unit/trace_files.h"
#include "unit/trace_mend.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define UNIT_MM (1.0 / TOUCH_PER_MM)

// ---- bytes

static struct touch_change random_touch(struct random *r, uint32_t count, uint32_t stride) {
    static const double sizes[] = {0, UNIT_MM, 1e-4, 0.1, 5, TOUCH_FARTHEST_MM};
    struct touch_change touch = {0};
    uint32_t vertex = (uint32_t)(random_bits(r) % stride);
    touch_change_make_room(&touch, 3, count);
    touch.count = count;
    for (uint32_t i = 0; i < count; i++) {
        touch.vertices[i] = vertex;
        vertex += 1 + (uint32_t)(random_bits(r) % stride);
        for (size_t k = 0; k < 3; k++) {
            double most = sizes[random_bits(r) % (sizeof sizes / sizeof *sizes)];
            touch.values[3 * i + k] = touch_rounded(random_between(r, -most, most));
        }
    }
    touch_encode(&touch);
    return touch;
}

static void assert_same_touch(const struct touch_change *a, const struct touch_change *b) {
    assert_int_equal(a->count, b->count);
    assert_int_equal(a->size, b->size);
    assert_memory_equal(a->vertices, b->vertices, a->count * sizeof *a->vertices);
    assert_memory_equal(a->values, b->values, 3 * a->count * sizeof *a->values);
    assert_memory_equal(a->bytes, b->bytes, a->size);
}

static void offsets_come_back_bit_for_bit(void **state) {
    (void)state;
    struct random r = {1};
    for (int i = 0; i < 300; i++) {
        uint32_t stride = i % 3 ? 4 : 100000;
        struct touch_change touch = random_touch(&r, (uint32_t)(i * i) % 4000 + 1, stride), back;
        assert_true(touch.size > 0);
        assert_true(touch_decode(touch.bytes, touch.size, &back));
        assert_same_touch(&touch, &back);
        touch_change_fini(&touch);
        touch_change_fini(&back);
    }
}

static void rounding_is_to_the_nearest_and_knows_one_zero(void **state) {
    (void)state;
    struct random r = {2};
    for (int i = 0; i < 10000; i++) {
        double mm = random_between(&r, -20, 20), rounded = touch_rounded(mm);
        assert_true(fabs(rounded - mm) <= UNIT_MM / 2);
        assert_true(touch_rounded(rounded) == rounded);
        assert_true(rounded / UNIT_MM == rint(rounded / UNIT_MM));
    }
    assert_false(signbit(touch_rounded(-UNIT_MM / 4)));
}

static void far_vertices_and_long_changes_have_no_bytes(void **state) {
    (void)state;
    struct random r = {3};
    struct touch_change far = random_touch(&r, 10, 4), wild = random_touch(&r, 200000, 4);
    far.values[7] = TOUCH_FARTHEST_MM + UNIT_MM;
    touch_encode(&far);
    assert_int_equal(far.size, 0);
    far.values[7] = NAN;
    touch_encode(&far);
    assert_int_equal(far.size, 0);
    assert_int_equal(wild.size, 0);
    assert_int_equal(touch_hash(&wild), 0);
    touch_change_fini(&far);
    touch_change_fini(&wild);
}

static bool is_read(const uint8_t *bytes, size_t size) {
    struct touch_change touch;
    bool good = touch_decode(bytes, size, &touch);
    touch_change_fini(&touch);
    return good;
}

static void bytes_that_nobody_writes_are_refused(void **state) {
    (void)state;
    static const uint8_t good[] = {5, 0, 1, 2}, cut_off[] = {5, 0, 1}, endless[] = {5, 0, 1, 0x82},
                         long_form[] = {0x85, 0, 0, 1, 2},
                         far_out[] = {5, 0, 1, 0xff, 0xff, 0xff, 0x1f},
                         too_wide[] = {5, 0, 1, 0xff, 0xff, 0xff, 0xff, 0x1f},
                         too_many[] = {0xff, 0xff, 0xff, 0xff, 7, 0, 0, 0};
    assert_true(is_read(good, sizeof good));
    assert_false(is_read(cut_off, sizeof cut_off));
    assert_false(is_read(endless, sizeof endless));
    assert_false(is_read(long_form, sizeof long_form));
    assert_false(is_read(far_out, sizeof far_out));
    assert_false(is_read(too_wide, sizeof too_wide));
    assert_false(is_read(too_many, sizeof too_many));
}

// Any bytes are refused, or are those of what was read.
static void random_bytes_are_refused_or_come_back(void **state) {
    (void)state;
    struct random r = {4};
    int read = 0;
    for (int i = 0; i < 20000; i++) {
        uint8_t bytes[24];
        size_t size = 1 + random_bits(&r) % sizeof bytes;
        for (size_t k = 0; k < size; k++)
            bytes[k] = (uint8_t)(random_bits(&r) % (i % 2 ? 256 : 140));
        struct touch_change touch;
        if (touch_decode(bytes, size, &touch)) {
            touch_encode(&touch);
            assert_int_equal(touch.size, size);
            assert_memory_equal(touch.bytes, bytes, size);
            read++;
        }
        touch_change_fini(&touch);
    }
    assert_true(read > 100 && read < 19000);
}

// ---- records

#define JOB 9
#define TISSUE 2
#define STEPS 4
#define LANDING 2 // the step at which the job lands

static void append_landing(struct trace_writer *writer, const struct touch_change *touch) {
    struct session_input input;
    struct session_output output;
    struct job_result result = {.job = JOB, .tissue = TISSUE, .touch = *touch};
    step_at(LANDING, &input, &output);
    input = (struct session_input){
        .kind = INPUT_JOB, .time_ns = input.time_ns, .job = JOB, .result = &result};
    output.landed = (struct landed){.job = JOB, .tissue = TISSUE, .touch_hash = touch_hash(touch)};
    assert_true(trace_append(writer, &input, &output));
}

static void write_with_touch(const struct touch_change *touch) {
    struct trace_writer *writer = start_writing();
    for (uint64_t n = 1; n <= STEPS; n++)
        if (n == LANDING)
            append_landing(writer, touch);
        else
            assert_true(append_step(writer, n));
    trace_writer_destroy(&writer);
}

static void a_step_is_read_with_the_touch_that_lands_there(void **state) {
    (void)state;
    struct random r = {5};
    static const uint32_t counts[] = {1, 200, 3000, 40000};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        struct touch_change touch = random_touch(&r, counts[i], 4);
        struct trace_record record;
        size_t parts = 0;
        write_with_touch(&touch);
        struct trace_reader *reader = open_trace(path);
        while (trace_read(reader, &record, NULL) == RESULT_OK) {
            bool lands = record.type == TRACE_STEP && record.output.step == LANDING;
            parts += record.type == TRACE_TOUCH;
            assert_int_equal(record.touch != NULL, lands);
            if (!lands)
                continue;
            assert_int_equal(record.touch_tissue, TISSUE);
            assert_same_touch(record.touch, &touch);
        }
        assert_int_equal(parts, (touch.size + TOUCH_PART_MAX - 1) / TOUCH_PART_MAX);
        assert_int_equal(trace_read(reader, &record, NULL), RESULT_CLOSED);
        trace_reader_destroy(&reader);
        touch_change_fini(&touch);
    }
}

static void older_rules_have_no_touches(void **state) {
    (void)state;
    struct random r = {6};
    struct touch_change touch = random_touch(&r, 50, 4);
    struct trace_header header = some_header();
    struct trace_writer *writer;
    struct trace_record record;
    header.settings.rules = RULES_TOUCH_FITTED - 1;
    unlink(path);
    assert_int_equal(trace_writer_create(path, &header, NULL, NULL, &writer, NULL), RESULT_OK);
    assert_true(append_step(writer, 1));
    append_landing(writer, &touch);
    trace_writer_destroy(&writer);
    struct trace_reader *reader = open_trace(path);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        assert_true(record.type != TRACE_TOUCH && !record.touch);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_CLOSED);
    trace_reader_destroy(&reader);
    touch_change_fini(&touch);
}

static void a_copied_input_keeps_its_touch(void **state) {
    (void)state;
    struct random r = {7};
    struct touch_change touch = random_touch(&r, 2500, 4);
    struct trace_record record;
    struct trace_writer *writer;
    struct trace_header header = some_header();
    write_with_touch(&touch);
    unlink(copy_path);
    assert_int_equal(trace_writer_create(copy_path, &header, NULL, NULL, &writer, NULL), RESULT_OK);
    struct trace_reader *reader = open_trace(path);
    while (trace_read(reader, &record, NULL) == RESULT_OK) {
        if (record.type == TRACE_STEP && record.output.step <= LANDING)
            record.type = TRACE_PAST;
        assert_int_equal(trace_append_record(writer, &record, NULL), RESULT_OK);
    }
    trace_writer_destroy(&writer);
    trace_reader_destroy(&reader);
    reader = open_trace(copy_path);
    int touches = 0;
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        if (record.touch) {
            assert_int_equal(record.type, TRACE_PAST);
            assert_same_touch(record.touch, &touch);
            touches++;
        }
    assert_int_equal(touches, 1);
    trace_reader_destroy(&reader);
    touch_change_fini(&touch);
}

// ---- forged records

struct file {
    uint8_t *data;
    size_t size;
    size_t at[16]; // records: step 1, the parts, step 2, ...
    size_t count;
};

static struct file file_with_touch(uint32_t vertices) {
    struct random r = {8};
    struct touch_change touch = random_touch(&r, vertices, 4);
    struct file file = {0};
    struct trace_record record;
    write_with_touch(&touch);
    touch_change_fini(&touch);
    struct trace_reader *reader = open_trace(path);
    file.size = trace_reader_size(reader);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        file.at[file.count++] = record.offset;
    trace_reader_destroy(&reader);
    file.data = alloc(file.size, 1);
    FILE *from = fopen(path, "rb");
    assert_int_equal(fread(file.data, 1, file.size, from), file.size);
    fclose(from);
    return file;
}

static void take_out(struct file *file, size_t record) {
    size_t from = file->at[record], to = file->at[record + 1];
    memmove(file->data + from, file->data + to, file->size - to);
    file->size -= to - from;
}

static void assert_refused(struct file *file, const char *why) {
    struct trace_record record;
    struct error err = {""};
    enum result result;
    trace_mend(file->data, file->size);
    FILE *out = fopen(copy_path, "wb");
    assert_int_equal(fwrite(file->data, 1, file->size, out), file->size);
    fclose(out);
    struct trace_reader *reader = open_trace(copy_path);
    while ((result = trace_read(reader, &record, &err)) == RESULT_OK)
        continue;
    assert_int_equal(result, RESULT_FORMAT);
    if (!strstr(err.text, why) || !strstr(err.text, ", byte "))
        fail_msg("\"%s\" does not tell: %s", err.text, why);
    trace_reader_destroy(&reader);
    free(file->data);
}

static void what_is_wrong_with_a_touch_is_named(void **state) {
    (void)state;
    struct file file = file_with_touch(3000); // some parts
    assert_true(file.count > 7);
    take_out(&file, 2);
    assert_refused(&file, "a part of the touched surface of job 9 is missing");
    file = file_with_touch(200); // step, part, step, ...
    take_out(&file, 1);
    assert_refused(&file, "the touched surface of job 9 does not have its hash");
    file = file_with_touch(200);
    file.data[file.at[1] + RECORD_PREFIX + TOUCH_PREFIX] ^= 1; // the first vertex
    assert_refused(&file, "the touched surface of job 9 does not have its hash");
    file = file_with_touch(200);
    file.data[file.at[2] - TRACE_HASH_SIZE - 1] |= 0x80; // the last offset goes on
    assert_refused(&file, "the touched surface of job 9 is malformed");
    file = file_with_touch(200);
    take_out(&file, 2);
    assert_refused(&file, "the touched surface of job 9 does not land");
    file = file_with_touch(200);
    file.data[file.at[1] + RECORD_PREFIX + 8] = TISSUES_MAX; // the tissue
    assert_refused(&file, "a field of a record is out of range");
    file = file_with_touch(200);
    memset(file.data + file.at[1] + RECORD_PREFIX + 9, 0xff, 4); // bytes of all parts
    assert_refused(&file, "a field of a record is out of range");
}

// What is read behind damage lacks the touch, and nothing else.
static void behind_damage_a_touch_may_be_missing(void **state) {
    (void)state;
    struct file file = file_with_touch(3000);
    struct trace_record record;
    uint64_t bytes, last = 0;
    file.data[file.at[1] + RECORD_PREFIX + 40] ^= 1; // in the first part; not mended
    FILE *out = fopen(copy_path, "wb");
    assert_int_equal(fwrite(file.data, 1, file.size, out), file.size);
    fclose(out);
    struct trace_reader *reader = open_trace(copy_path);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_CORRUPT);
    assert_int_equal(trace_skip_damage(reader, &bytes, NULL), RESULT_OK);
    while (trace_read(reader, &record, NULL) == RESULT_OK) {
        assert_null(record.touch);
        last = record.type == TRACE_STEP ? record.output.step : last;
    }
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_CLOSED);
    assert_int_equal(last, STEPS);
    trace_reader_destroy(&reader);
    free(file.data);
}

static void a_touch_without_its_landing_is_cut_off(void **state) {
    (void)state;
    struct file file = file_with_touch(3000);
    struct trace_record record;
    struct trace_writer *writer;
    struct error err = {""};
    int resumes = 0;
    assert_int_equal(truncate(path, (off_t)file.at[3]), 0); // killed after two parts
    struct trace_reader *reader = open_trace(path);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        continue;
    struct trace_place place = trace_reader_place(reader);
    assert_int_equal(place.offset, file.at[1]);
    assert_int_equal(place.step, 1);
    trace_reader_destroy(&reader);
    assert_ok(trace_writer_resume(path, &place, 1, NULL, NULL, &writer, &err));
    assert_true(append_step(writer, 2));
    trace_writer_destroy(&writer);
    reader = open_trace(path);
    while (trace_read(reader, &record, &err) == RESULT_OK)
        resumes += record.type == TRACE_RESUME;
    assert_int_equal(trace_read(reader, &record, &err), RESULT_CLOSED);
    assert_int_equal(resumes, 1);
    trace_reader_destroy(&reader);
    free(file.data);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(offsets_come_back_bit_for_bit),
        cmocka_unit_test(rounding_is_to_the_nearest_and_knows_one_zero),
        cmocka_unit_test(far_vertices_and_long_changes_have_no_bytes),
        cmocka_unit_test(bytes_that_nobody_writes_are_refused),
        cmocka_unit_test(random_bytes_are_refused_or_come_back),
        cmocka_unit_test(a_step_is_read_with_the_touch_that_lands_there),
        cmocka_unit_test(older_rules_have_no_touches),
        cmocka_unit_test(a_copied_input_keeps_its_touch),
        cmocka_unit_test(what_is_wrong_with_a_touch_is_named),
        cmocka_unit_test(behind_damage_a_touch_may_be_missing),
        cmocka_unit_test(a_touch_without_its_landing_is_cut_off),
    };
    return cmocka_run_group_tests_name("trace_touch", tests, make_folder, remove_folder);
}
