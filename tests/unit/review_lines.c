// What a review reads and draws of a trace whose server was killed in the middle.
#include "review/lines.h"
#include "test.h"
#include "unit/trace_files.h"

#include <math.h>
#include <stdlib.h>

#define HALF 5
#define RESUMED_UTC_NS 1790500000000000000
#define NS_A_STEP 1000000

static void append(struct trace_writer *writer, uint64_t first) {
    struct session_input input;
    struct session_output output;
    for (uint64_t n = first; n < first + HALF; n++) {
        step_at(n, &input, &output);
        output.joint_validity = VALIDITY_OK;
        output.joint.flexion_deg = (double)n;
        output.instruments[0].present = true;
        output.instruments[0].discrepancy.offset_mm = (double)n;
        assert_true(trace_append(writer, &input, &output));
    }
}

static struct trace_place end_of_first_half(void) {
    struct trace_reader *reader;
    struct trace_record record;
    assert_int_equal(trace_reader_create(path, &reader, NULL), RESULT_OK);
    for (int i = 0; i < HALF; i++)
        assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    struct trace_place place = trace_reader_place(reader);
    trace_reader_destroy(&reader);
    return place;
}

static void write_resumed(void) {
    struct trace_writer *writer = start_writing();
    append(writer, 1);
    trace_writer_destroy(&writer);
    struct trace_place place = end_of_first_half();
    assert_int_equal(trace_writer_resume(path, &place, RESUMED_UTC_NS, NULL, NULL, &writer, NULL),
                     RESULT_OK);
    append(writer, HALF + 1);
    trace_writer_destroy(&writer);
}

static struct report_lines *read_lines(void) {
    struct report_lines *lines = malloc(sizeof *lines);
    static struct survey survey;
    static struct metrics metrics;
    struct trace_reader *reader;
    assert_int_equal(trace_reader_create(path, &reader, NULL), RESULT_OK);
    survey_read(reader, NULL, &survey);
    assert_int_equal(survey.resumes, 1);
    trace_reader_destroy(&reader);
    assert_int_equal(trace_reader_create(path, &reader, NULL), RESULT_OK);
    metrics_init(&metrics, instruments_usual(), view_optic_usual());
    assert_int_equal(report_lines_read(reader, &survey, NULL, lines, &metrics, NULL), RESULT_OK);
    trace_reader_destroy(&reader);
    return lines;
}

static void assert_halves(const struct thin *line) {
    static double x[THIN_POINTS], y[THIN_POINTS];
    assert_int_equal(thin_points(line, x, y), 2 * HALF + 1);
    for (int i = 0; i <= 2 * HALF; i++)
        if (i == HALF)
            assert_true(isnan(x[i]) && isnan(y[i]));
        else
            assert_true(y[i] == (i < HALF ? i + 1 : i));
}

static void no_line_is_drawn_over_the_time_without_a_server(void **state) {
    (void)state;
    write_resumed();
    struct report_lines *lines = read_lines();
    assert_halves(&lines->flexion);
    assert_halves(&lines->tips[0].lines[TIP_OFFSET]);
    free(lines);
}

// A certificate that was renewed meanwhile signed it.
static void the_end_was_written_after_the_server_came_back(void **state) {
    (void)state;
    static struct survey survey;
    write_resumed();
    struct trace_reader *reader = open_trace(path);
    survey_read(reader, NULL, &survey);
    trace_reader_destroy(&reader);
    assert_int_equal(survey.written_utc_ns, RESUMED_UTC_NS + HALF * NS_A_STEP);
    write_trace(HALF);
    reader = open_trace(path);
    int64_t start_utc_ns = trace_reader_header(reader)->start_utc_ns;
    survey_read(reader, NULL, &survey);
    trace_reader_destroy(&reader);
    assert_int_equal(survey.written_utc_ns, start_utc_ns + (HALF - 1) * NS_A_STEP);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_line_is_drawn_over_the_time_without_a_server),
        cmocka_unit_test(the_end_was_written_after_the_server_came_back),
    };
    return cmocka_run_group_tests_name("review_lines", tests, make_folder, remove_folder);
}
