// Traces of older versions, as those wrote them: of a knee of boxes, and of made up steps.
#include "test.h"
#include "trace/replay.h"
#include "unit/case_knee.h"

#include <stdio.h>

static struct trace_reader *open_old(const char *name) {
    struct trace_reader *reader;
    struct error err = {""};
    char file[512];
    snprintf(file, sizeof file, "%s/%s", CORPUS, name);
    if (trace_reader_create(file, &reader, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return reader;
}

static void its_fields_come_back_and_those_it_has_not_are_the_defaults(void **state) {
    (void)state;
    struct trace_reader *reader = open_old("version2-steps.trace");
    const struct trace_header *header = trace_reader_header(reader);
    struct session_settings defaults = session_settings_default();
    assert_int_equal(header->version, 2);
    assert_string_equal(header->station, "bench");
    assert_string_equal(header->trainee, "Zoë");
    assert_int_equal(header->settings.avatar, AVATAR_TIP);
    assert_int_equal(header->settings.adaptive, ADAPTIVE_HINGE);
    assert_memory_equal(header->settings.bodies, defaults.bodies, sizeof defaults.bodies);
    assert_true(header->settings.field.radius_mm == 12);
    assert_true(header->settings.field.strength == 1);
    assert_true(header->optic.tilt_deg == 30 && header->optic.field_deg == 90);
    struct trace_record record;
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    const struct frame *frame = &record.input.frame;
    assert_int_equal(frame->number, 7);
    assert_int_equal(frame->count, 3);
    assert_true(frame->samples[0].joint.flexion_deg == 30);
    assert_true(frame->samples[1].T_mockup_body.translation.z == 30);
    assert_true(frame->samples[2].handle.opening == 0.25);
    assert_true(record.output.instruments[0].present);
    assert_int_equal(record.output.torn_count, 0);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_OK);
    assert_int_equal(record.type, TRACE_END);
    assert_int_equal(trace_read(reader, &record, NULL), RESULT_CLOSED);
    struct trace_seal seal;
    assert_false(trace_reader_seal(reader, &seal));
    trace_reader_destroy(&reader);
}

static void version_3_knows_no_optic(void **state) {
    (void)state;
    struct trace_reader *reader = open_old("version3-steps.trace");
    const struct trace_header *header = trace_reader_header(reader);
    assert_int_equal(header->version, 3);
    assert_string_equal(header->trainee, "Zoë");
    assert_true(header->optic.tilt_deg == 30 && header->optic.field_deg == 90);
    struct trace_record record;
    int steps = 0;
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        steps += record.type == TRACE_STEP;
    assert_int_equal(steps, 3);
    trace_reader_destroy(&reader);
}

static void assert_replays(const char *name) {
    struct trace_reader *reader = open_old(name);
    struct knee_case *knee = box_knee();
    struct scene *scene;
    struct replay_report report;
    assert_int_equal(scene_create(&knee, &scene, NULL), RESULT_OK);
    assert_int_equal(trace_replay(reader, scene, NULL, NULL, &report, NULL), RESULT_OK);
    assert_int_equal(report.end, RESULT_CLOSED);
    assert_int_equal(report.steps, 8);
    if (report.different)
        fail_msg("%s, step %d: %s was %s, now %s", name, (int)report.first.step, report.first.field,
                 report.first.recorded, report.first.replayed);
    assert_false(report.same_build);
    scene_destroy(&scene);
    trace_reader_destroy(&reader);
}

static void they_replay_in_all_that_they_have(void **state) {
    (void)state;
    assert_replays("version2-cut.trace");
    assert_replays("version3-cut.trace");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(its_fields_come_back_and_those_it_has_not_are_the_defaults),
        cmocka_unit_test(version_3_knows_no_optic),
        cmocka_unit_test(they_replay_in_all_that_they_have),
    };
    return cmocka_run_group_tests_name("trace_old", tests, NULL, NULL);
}
