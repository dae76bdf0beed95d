// What the tap of a trace is told: all that another server needs, in order, and nothing twice.
#include "base/check.h"
#include "test.h"
#include "unit/trace_files.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define TOLD_MAX 8192

struct told {
    int count;
    struct {
        enum trace_record_type type;
        uint64_t offset, step;
    } of[TOLD_MAX];
};

static void note(struct told *told, const struct trace_record *record) {
    CHECK(told->count < TOLD_MAX);
    told->of[told->count].type = record->type;
    told->of[told->count].offset = record->offset;
    told->of[told->count++].step = record->output.step;
}

static void take(void *user, const struct trace_record *record) {
    note(user, record);
}

static bool is_to_tell(const struct trace_record *r) {
    if (r->type == TRACE_STEP)
        return r->input.kind == INPUT_JOB || input_is_command(r->input.kind) || r->output.job.id;
    return r->type != TRACE_END && r->type != TRACE_GAP && r->type != TRACE_RESUME;
}

static void assert_tells_the_file(const struct told *told, uint64_t from) {
    struct told there = {0};
    struct trace_reader *reader = open_trace(path);
    struct trace_record record;
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        if (record.offset >= from && is_to_tell(&record))
            note(&there, &record);
    trace_reader_destroy(&reader);
    assert_int_equal(told->count, there.count);
    for (int i = 0; i < there.count; i++) {
        assert_int_equal(told->of[i].type, there.of[i].type);
        assert_int_equal(told->of[i].offset, there.of[i].offset);
        assert_int_equal(told->of[i].step, there.of[i].step);
    }
}

static struct trace_writer *start_tapped(const struct trace_tap *tap) {
    struct trace_header header = some_header();
    struct trace_writer *writer;
    struct error err;
    unlink(path);
    assert_ok(trace_writer_create(path, &header, NULL, tap, &writer, &err));
    return writer;
}

static void append_remark(struct trace_writer *writer, uint64_t n) {
    struct remark remark = {.number = 1 + (uint32_t)(n % 50), .text = "here"};
    assert_true(trace_append_remark(writer, &remark));
}

// Faster than they are written: more steps than there is room to note.
static void it_is_told_all_that_matters_in_order(void **state) {
    (void)state;
    struct told *told = alloc(1, sizeof *told);
    struct trace_tap tap = {take, told};
    struct trace_writer *writer = start_tapped(&tap);
    for (uint64_t n = 1; n <= 6000; n++) {
        while (!append_step(writer, n))
            fail_msg("step %d has no room", (int)n);
        if (n % 100 == 0)
            append_remark(writer, n);
        while (n % 1000 == 0 && !trace_is_on_disk(writer, trace_position(writer)))
            usleep(1000);
    }
    trace_writer_destroy(&writer);
    assert_true(told->count > 3000);
    assert_tells_the_file(told, 0);
    free(told);
}

static void a_resumed_trace_tells_from_there_on(void **state) {
    (void)state;
    struct told *told = alloc(1, sizeof *told);
    struct trace_tap tap = {take, told};
    struct trace_writer *writer = start_writing();
    struct trace_record record;
    struct error err;
    for (uint64_t n = 1; n <= 20; n++)
        assert_true(append_step(writer, n));
    trace_writer_leave(&writer);
    struct trace_reader *reader = open_trace(path);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        continue;
    struct trace_place end = trace_reader_place(reader);
    trace_reader_destroy(&reader);
    assert_ok(trace_writer_resume(path, &end, 1, NULL, &tap, &writer, &err));
    for (uint64_t n = 21; n <= 60; n++)
        assert_true(append_step(writer, n));
    append_remark(writer, 1);
    trace_writer_destroy(&writer);
    assert_true(told->count > 10);
    assert_tells_the_file(told, end.offset);
    free(told);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_is_told_all_that_matters_in_order),
        cmocka_unit_test(a_resumed_trace_tells_from_there_on),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
