// A session is replayed by a build whose match is another one: here it fits to another volume.
#include "base/check.h"
#include "match/conform.h"
#include "replay/program.h"
#include "replay/recording.h"
#include "test.h"
#include "trace/replay.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define OTHER_MM3 3
#define WILD_MM 4

static bool match_is_another;

// The linker puts these in the place of each other (-Wl,--wrap).
void __real_conform_to(struct conform *conform, const struct conform_target *target,
                       struct conform_report *out_report);
void __wrap_conform_to(struct conform *conform, const struct conform_target *target,
                       struct conform_report *out_report);

void __wrap_conform_to(struct conform *conform, const struct conform_target *target,
                       struct conform_report *out_report) {
    struct conform_target other = *target;
    if (match_is_another)
        other.volume_mm3 -= OTHER_MM3;
    __real_conform_to(conform, &other, out_report);
}

static char forged_path[sizeof trace_path + 8];

// Another build has recorded it.
static int make_recorded_session(void **state) {
    int failed = make_session(state);
    if (failed)
        return failed;
    struct trace_header header = honest_header();
    snprintf(header.build, sizeof header.build, "another");
    snprintf(forged_path, sizeof forged_path, "%s.forged", trace_path);
    record(&header, 0, NULL);
    return 0;
}

static struct trace_reader *open_recorded(const char *path) {
    struct trace_reader *reader;
    struct error err = {""};
    assert_ok(trace_reader_create(path, &reader, &err));
    return reader;
}

static struct replay_report replay(const char *path, bool another_match) {
    struct trace_reader *reader = open_recorded(path);
    struct replay_report report;
    match_is_another = another_match;
    assert_int_equal(trace_replay(reader, played.scene, NULL, NULL, &report, NULL), RESULT_OK);
    match_is_another = false;
    trace_reader_destroy(&reader);
    return report;
}

static void steps_feel_what_was_recorded(void **state) {
    (void)state;
    struct replay_report report = replay(trace_path, true);
    assert_int_equal(report.end, RESULT_CLOSED);
    assert_int_equal(report.steps, recorded_steps);
    if (report.different)
        fail_msg("step %d: %s was %s, now %s", (int)report.first.step, report.first.field,
                 report.first.recorded, report.first.replayed);
    assert_int_equal(report.verdict, REPLAY_IDENTICAL);
    assert_true(report.largest_mm == 0);
    assert_true(report.touches.landed >= 3);
    assert_true(report.touches.different > 0 && report.touches.largest_mm > 1e-3);
    assert_true(report.touches.first_step > 0 && report.touches.first_job > 0);
}

static void without_what_was_recorded_they_feel_something_else(void **state) {
    (void)state;
    struct trace_reader *reader = open_recorded(trace_path);
    struct trace_record record;
    struct session_output output;
    bool differs = false;
    match_is_another = true;
    struct rerun *rerun = rerun_create(played.scene, &trace_reader_header(reader)->settings);
    while (!differs && trace_read(reader, &record, NULL) == RESULT_OK) {
        if (record.type != TRACE_STEP)
            continue;
        record.touch = NULL;
        rerun_step(rerun, &record, &output);
        differs = output.hash != record.output.hash;
    }
    match_is_another = false;
    rerun_destroy(&rerun);
    trace_reader_destroy(&reader);
    assert_true(differs);
}

// ---- a reader in another language

#define OUT_MAX ((size_t)1 << 20)

static size_t print_touch(const struct trace_record *record, char *out, size_t size) {
    const struct touch_change *touch = record->touch;
    size_t used = 0;
    for (uint32_t i = 0; i < touch->count; i++) {
        const double *offset = touch->values + 3 * (size_t)i;
        used += (size_t)snprintf(out + used, size - used, "%d %d %u %.17g %.17g %.17g\n",
                                 (int)record->input.job, record->touch_tissue, touch->vertices[i],
                                 offset[0], offset[1], offset[2]);
        assert_true(used < size);
    }
    return used;
}

static void a_script_reads_the_same_offsets(void **state) {
    (void)state;
    struct trace_record step;
    char *here = alloc(OUT_MAX, 1), *there = alloc(OUT_MAX, 1);
    size_t used = 0;
    struct trace_reader *reader = open_recorded(trace_path);
    while (trace_read(reader, &step, NULL) == RESULT_OK)
        if (step.touch)
            used += print_touch(&step, here + used, OUT_MAX - used);
    trace_reader_destroy(&reader);
    assert_in_range(used, 5000, OUT_MAX);
    assert_int_equal(run_program("python3 " EXAMPLE, trace_path, there, OUT_MAX), 0);
    assert_string_equal(here, there);
    free(here);
    free(there);
}

// ---- forged touches

// Writes the trace anew, as this build would have, with other touches and their hashes.
static void forge(void (*change)(struct touch_change *touch)) {
    struct trace_header header = honest_header();
    struct trace_writer *writer;
    struct trace_record step;
    struct error err = {""};
    unlink(forged_path);
    assert_ok(trace_writer_create(forged_path, &header, NULL, NULL, &writer, &err));
    struct trace_reader *reader = open_recorded(trace_path);
    while (trace_read(reader, &step, NULL) == RESULT_OK) {
        struct touch_change touch = {0};
        if (step.touch) {
            assert_true(touch_decode(step.touch->bytes, step.touch->size, &touch));
            change(&touch);
            touch_encode(&touch);
            step.touch = &touch;
            step.output.landed.touch_hash = step.output.landed.job ? touch_hash(&touch) : 0;
        }
        assert_ok(trace_append_record(writer, &step, &err));
        touch_change_fini(&touch);
    }
    trace_reader_destroy(&reader);
    trace_writer_destroy(&writer);
}

static void take_none(struct touch_change *touch) {
    (void)touch;
}

static void another_touch_of_the_same_build_is_a_fault(void **state) {
    (void)state;
    forge(take_none);
    struct replay_report same = replay(forged_path, false), other = replay(forged_path, true);
    assert_int_equal(same.verdict, REPLAY_IDENTICAL);
    assert_int_equal(same.touches.different, 0);
    assert_int_equal(other.different, 0);
    assert_int_equal(other.verdict, REPLAY_DIFFERENT);
    assert_true(other.touches.different > 0);
}

static void go_wild(struct touch_change *touch) {
    for (uint32_t i = 0; i < 3 * touch->count; i++)
        touch->values[i] = i % 2 ? WILD_MM : -WILD_MM;
}

static void a_touch_through_itself_is_played_and_found(void **state) {
    (void)state;
    forge(go_wild);
    struct replay_report report = replay(forged_path, false);
    assert_int_equal(report.end, RESULT_CLOSED);
    assert_int_equal(report.verdict, REPLAY_DIFFERENT);
    assert_true(report.touches.largest_mm > WILD_MM);
}

static void take_another_vertex(struct touch_change *touch) {
    touch->vertices[touch->count - 1] += 1000000;
}

static void a_touch_of_vertices_that_are_not_there_is_refused(void **state) {
    (void)state;
    forge(take_another_vertex);
    struct replay_report report = replay(forged_path, false);
    assert_int_equal(report.end, RESULT_FORMAT);
    assert_non_null(strstr(report.why.text, "has vertices that its case does not have"));
    assert_non_null(strstr(report.why.text, ", byte "));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(steps_feel_what_was_recorded),
        cmocka_unit_test(without_what_was_recorded_they_feel_something_else),
        cmocka_unit_test(a_script_reads_the_same_offsets),
        cmocka_unit_test(another_touch_of_the_same_build_is_a_fault),
        cmocka_unit_test(a_touch_through_itself_is_played_and_found),
        cmocka_unit_test(a_touch_of_vertices_that_are_not_there_is_refused),
    };
    return cmocka_run_group_tests_name("replay_touch", tests, make_recorded_session,
                                       remove_session);
}
