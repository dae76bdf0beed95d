#include "trace/replay.h"

#include "base/check.h"
#include "replay/recording.h"
#include "test.h"
#include "trace/record.h"
#include "unit/trace_mend.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static enum result replay(const struct scene *scene, struct replay_report *out_report) {
    struct trace_reader *reader;
    struct error err = {""};
    if (trace_reader_create(trace_path, &reader, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    enum result result = trace_replay(reader, scene, NULL, NULL, out_report, &err);
    trace_reader_destroy(&reader);
    return result;
}

// ---- the tests

static void a_recorded_session_replays_without_a_difference(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    record(&header, 0, NULL);
    struct replay_report report;
    assert_int_equal(replay(played.scene, &report), RESULT_OK);
    assert_int_equal(report.end, RESULT_CLOSED);
    assert_int_equal(report.steps, recorded_steps);
    assert_int_equal(report.different, 0);
    assert_int_equal(report.verdict, REPLAY_IDENTICAL);
    assert_true(report.same_build && report.same_libc && report.same_cpu && report.same_events);
    assert_true(report.session_ns > 0);
    assert_int_equal(report.left_out, 0);
}

static void *replay_beside(void *report) {
    struct replay_report *r = report;
    CHECK(replay(played.scene, r) == RESULT_OK);
    return NULL;
}

// Whatever runs beside it on the same scene.
static void sessions_side_by_side_replay_without_a_difference(void **state) {
    (void)state;
    static const int rows[] = {1, 2, 4};
    struct replay_report reports[4];
    pthread_t threads[4];
    struct trace_header header = honest_header();
    record(&header, 0, NULL);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        for (int k = 0; k < rows[i]; k++)
            pthread_create(&threads[k], NULL, replay_beside, &reports[k]);
        for (int k = 0; k < rows[i]; k++) {
            pthread_join(threads[k], NULL);
            assert_int_equal(reports[k].steps, recorded_steps);
            assert_int_equal(reports[k].verdict, REPLAY_IDENTICAL);
        }
    }
}

// The session that is recorded must be worth replaying.
static void the_session_that_is_replayed_has_displacement_contact_loss_and_cuts(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    record(&header, 0, NULL);
    struct trace_reader *reader;
    struct trace_record step;
    assert_int_equal(trace_reader_create(trace_path, &reader, NULL), RESULT_OK);
    uint32_t events = 0, cuts = 0;
    double largest = 0;
    while (trace_read(reader, &step, NULL) == RESULT_OK) {
        events |= step.output.events;
        cuts += step.output.landed.job && step.output.landed.outcome == JOB_DONE;
        largest = fmax(largest, vec3_length(step.output.instruments[0].warp.displacement));
    }
    trace_reader_destroy(&reader);
    assert_true(largest > 0.5);
    assert_true(cuts >= 3);
    assert_int_equal(events, EVENT_STATE | EVENT_DEVICE_LOST | EVENT_DEVICE_BACK | EVENT_CONTACT |
                                 EVENT_RELEASE | EVENT_CUT | EVENT_UNDONE);
}

// Leaves numbers that are none where the next step has its variables.
static void poison_stack(void) {
    volatile uint8_t junk[1 << 16];
    for (size_t i = 0; i < sizeof junk; i++)
        junk[i] = 0xff;
}

static void assert_finite(void *context, const struct session_input *input,
                          const struct session_output *output) {
    (void)context, (void)input;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        vec3 tip = output->instruments[i].T_mockup_warped.translation;
        assert_true(isfinite(tip.x) && isfinite(tip.y) && isfinite(tip.z));
    }
    poison_stack();
}

static void no_step_hangs_on_what_lies_in_memory(void **state) {
    (void)state;
    for (int mode = 0; mode < AVATAR_MODE_COUNT; mode++) {
        struct session_settings settings = session_settings_default();
        settings.avatar = (enum avatar_mode)mode;
        played_run(&played, &settings, 1000, assert_finite, NULL);
    }
}

static void another_field_setting_is_found(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    header.settings.field.radius_mm += 1e-9; // the session ran without
    record(&header, 0, NULL);
    struct replay_report report;
    assert_int_equal(replay(played.scene, &report), RESULT_OK);
    assert_true(report.different > 0);
    assert_int_equal(report.verdict, REPLAY_DIFFERENT);
    assert_int_equal(strncmp(report.first.field, "probe_", 6), 0);
    assert_true(report.largest_mm > 0);
    assert_string_not_equal(report.first.recorded, report.first.replayed);
}

static void nudge_last_bit(struct session_output *output) {
    double *x = &output->instruments[0].T_mockup_warped.translation.x;
    *x = nextafter(*x, INFINITY);
}

static void nudge_micrometre(struct session_output *output) {
    output->instruments[0].T_mockup_warped.translation.x += 1e-3;
}

static void add_event(struct session_output *output) {
    output->events ^= EVENT_CONTACT;
}

static void the_first_difference_is_named(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    record(&header, 500, nudge_last_bit);
    struct replay_report report;
    assert_int_equal(replay(played.scene, &report), RESULT_OK);
    assert_int_equal(report.first.step, 500);
    assert_string_equal(report.first.field, "probe_warped_tx_mm");
    assert_true(report.different > 1 && report.different <= recorded_steps - 499);
    assert_true(report.largest_mm > 0 && report.largest_mm < 1e-12);
    assert_int_equal(report.verdict, REPLAY_DIFFERENT);
}

static void another_machine_may_differ_by_its_mathematics_and_no_more(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    snprintf(header.libc, sizeof header.libc, "glibc 2.99");
    static const struct {
        void (*change)(struct session_output *);
        enum replay_verdict expected;
    } rows[] = {
        {NULL, REPLAY_IDENTICAL},
        {nudge_last_bit, REPLAY_EQUIVALENT},
        {nudge_micrometre, REPLAY_DIFFERENT},
        {add_event, REPLAY_DIFFERENT},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        record(&header, 100, rows[i].change);
        struct replay_report report;
        assert_int_equal(replay(played.scene, &report), RESULT_OK);
        assert_int_equal(report.verdict, rows[i].expected);
        assert_false(report.same_libc);
        assert_true(report.same_build);
    }
}

static void flip_byte(const char *file, long from_end) {
    FILE *f = fopen(file, "r+b");
    assert_non_null(f);
    fseek(f, -from_end, SEEK_END);
    int byte = fgetc(f);
    fseek(f, -from_end, SEEK_END);
    fputc(byte ^ 1, f);
    fclose(f);
}

static void a_case_with_one_changed_byte_is_found(void **state) {
    (void)state;
    char file[128];
    snprintf(file, sizeof file, "%s/anatomy.glb", case_dir);
    flip_byte(file, 8);
    struct case_limits limits = case_limits_default();
    struct knee_case *knee;
    assert_int_equal(case_load(case_dir, &limits, &knee, NULL), RESULT_CORRUPT);
    flip_byte(file, 8);
    assert_int_equal(case_load(case_dir, &limits, &knee, NULL), RESULT_OK);
    assert_true(knee->hash == scene_case(played.scene)->hash);
    case_destroy(&knee);
}

static void another_case_is_refused(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    header.case_hash ^= 1;
    record(&header, 0, NULL);
    struct replay_report report;
    assert_int_equal(replay(played.scene, &report), RESULT_REFUSED);
}

// Puts a gap in the place of a step, and leaves the end record out.
static void replace_by_gap(uint64_t step) {
    struct trace_reader *reader;
    struct trace_record record;
    uint8_t gap[RECORD_MAX];
    assert_int_equal(trace_reader_create(trace_path, &reader, NULL), RESULT_OK);
    uint64_t at = 0, after = 0, end = 0;
    while (trace_read(reader, &record, NULL) == RESULT_OK) {
        if (record.type == TRACE_END)
            end = record.offset;
        else if (record.output.step == step)
            at = record.offset, after = record.offset + record.size;
    }
    uint64_t size = trace_reader_size(reader);
    trace_reader_destroy(&reader);
    uint8_t *data = calloc(1, size + RECORD_MAX);
    FILE *f = fopen(trace_path, "r+b");
    assert_int_equal(fread(data, 1, size, f), size);
    struct chain chain;
    chain_init(&chain);
    size_t gap_size = record_encode_gap(1, &chain, gap);
    chain_fini(&chain);
    memmove(data + at + gap_size, data + after, end - after);
    memcpy(data + at, gap, gap_size);
    size = at + gap_size + end - after;
    trace_mend(data, size);
    rewind(f);
    fwrite(data, 1, size, f);
    fflush(f);
    assert_int_equal(ftruncate(fileno(f), (off_t)size), 0);
    fclose(f);
    free(data);
}

static void steps_after_a_gap_are_left_out_and_counted(void **state) {
    (void)state;
    struct trace_header header = honest_header();
    record(&header, 0, NULL);
    replace_by_gap(300);
    struct replay_report report;
    assert_int_equal(replay(played.scene, &report), RESULT_OK);
    assert_int_equal(report.end, RESULT_MISSING);
    assert_int_equal(report.steps, 299);
    assert_int_equal(report.left_out, recorded_steps - 299);
    assert_int_equal(report.different, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recorded_session_replays_without_a_difference),
        cmocka_unit_test(sessions_side_by_side_replay_without_a_difference),
        cmocka_unit_test(the_session_that_is_replayed_has_displacement_contact_loss_and_cuts),
        cmocka_unit_test(no_step_hangs_on_what_lies_in_memory),
        cmocka_unit_test(another_field_setting_is_found),
        cmocka_unit_test(the_first_difference_is_named),
        cmocka_unit_test(another_machine_may_differ_by_its_mathematics_and_no_more),
        cmocka_unit_test(a_case_with_one_changed_byte_is_found),
        cmocka_unit_test(another_case_is_refused),
        cmocka_unit_test(steps_after_a_gap_are_left_out_and_counted),
    };
    return cmocka_run_group_tests_name("replay", tests, make_session, remove_session);
}
