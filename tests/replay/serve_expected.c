#include "replay/serve_expected.h"

#include "base/clock.h"
#include "test.h"
#include "trace/rerun.h"

#include <stdio.h>
#include <string.h>

char served_path[FOLDER_MAX + 32];

static const int64_t start_utc_ns = 1764000000 * NS_PER_S + 123456789;

// ---- the session --------------------------------------------------------------------------------

static void add_notes(struct trace_writer *writer, int64_t time_ns) {
    struct remark said = {.number = 1, .time_ns = time_ns, .author = "Ada", .text = "slower"};
    struct remark point = {.number = 2,
                           .time_ns = time_ns,
                           .text = "here",
                           .has_marker = true,
                           .body = BODY_TIBIA,
                           .point = {1, 2.25, -3}};
    assert_true(trace_append_remark(writer, &said));
    assert_true(trace_append_remark(writer, &point));
    struct marker pulse = {.run = 1,
                           .number = 1,
                           .time_ns = time_ns - 5000000,
                           .value = 0.5,
                           .name = "pulse",
                           .device = "box"};
    assert_true(trace_append_marker(writer, &pulse));
}

// The recorded session with a date, and remarks and a marker after its hundredth step.
int make_served(void **state) {
    struct trace_reader *reader;
    struct trace_writer *writer;
    struct trace_record record;
    struct error err = {""};
    if (make_bites(state) != 0)
        return -1;
    snprintf(served_path, sizeof served_path, "%s-served", trace_path);
    struct trace_header header = bites_header();
    header.start_utc_ns = start_utc_ns;
    assert_ok(trace_writer_create(served_path, &header, NULL, NULL, &writer, &err));
    assert_ok(trace_reader_create(trace_path, &reader, &err));
    while (trace_read(reader, &record, &err) == RESULT_OK) {
        if (record.type != TRACE_END && record.type != TRACE_TOUCH)
            assert_ok(trace_append_record(writer, &record, &err));
        if (record.type == TRACE_STEP && record.output.step == 100)
            add_notes(writer, record.output.time_ns);
    }
    trace_reader_destroy(&reader);
    trace_writer_destroy(&writer);
    return 0;
}

struct expected expected;

static int64_t utc_of(int64_t time_ns) {
    return start_utc_ns + time_ns;
}

static void expect_pose(struct expected_set *set, const char *name, const char *after,
                        int64_t time_ns, pose T) {
    struct expected_pose *p = &set->poses[set->count++];
    snprintf(p->name, sizeof p->name, "%s%s", name, after);
    p->stamp_ns = utc_of(time_ns);
    p->T = T;
}

static void expect_set(const struct session_input *input, const struct session_output *o) {
    static const char *const bones[] = {"femur", "tibia", "patella"};
    static const char *const shown[] = {"virtual_femur", "virtual_tibia", "virtual_patella"};
    static int64_t measured_ns[CHANNEL_COUNT];
    if (input->kind != INPUT_FRAME)
        return;
    for (int i = 0; i < input->frame.count; i++)
        if (input->frame.samples[i].kind != SAMPLE_HANDLE)
            measured_ns[input->frame.samples[i].channel] = input->frame.samples[i].time_ns;
    assert_in_range(expected.set_count, 0, SETS_MAX - 1);
    struct expected_set *set = &expected.sets[expected.set_count++];
    set->stamp_ns = utc_of(o->time_ns);
    for (int i = 0; i < BODY_COUNT; i++) {
        if (i != BODY_FEMUR && o->joint_validity == VALIDITY_LOST)
            continue;
        expect_pose(set, bones[i], "", measured_ns[CHANNEL_JOINT], o->T_mockup_body[i]);
        expect_pose(set, shown[i], "", measured_ns[CHANNEL_JOINT], o->T_mockup_virtual[i]);
    }
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct instrument_output *tool = &o->instruments[i];
        enum channel channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + i);
        if (!tool->present || tool->validity == VALIDITY_LOST)
            continue;
        expect_pose(set, channel_name(channel), "", measured_ns[channel], tool->T_mockup_tip);
        expect_pose(set, channel_name(channel), "_warped", measured_ns[channel],
                    tool->T_mockup_warped);
    }
}

static void expect_text(const char *device, int64_t time_ns, const char *text) {
    assert_in_range(expected.text_count, 0, TEXTS_MAX - 1);
    expected.text_stamps_ns[expected.text_count] = utc_of(time_ns);
    expected.text_devices[expected.text_count] = device;
    snprintf(expected.texts[expected.text_count++], sizeof expected.texts[0], "%s", text);
}

static void expect_state(const char *state) {
    if (expected.state_count && !strcmp(expected.states[expected.state_count - 1], state))
        return;
    snprintf(expected.states[expected.state_count++], sizeof expected.states[0], "%s", state);
}

static int medial; // the tissue
static int64_t step_ns;

static void expect_mesh(const struct operation *operation) {
    assert_in_range(expected.mesh_count, 0, MESHES_MAX - 1);
    expected.mesh_stamps_ns[expected.mesh_count] = utc_of(step_ns);
    cut_mesh_flatten(operation_mesh(operation, medial), &expected.meshes[expected.mesh_count++],
                     NULL, NULL);
}

static void on_landed(void *rerun, const struct job_result *result) {
    if (result->outcome == JOB_DONE && result->tissue == medial)
        expect_mesh(rerun_operation(rerun));
}

static void expect_step(struct rerun *rerun, const struct trace_record *record) {
    static const char *const states[] = {"waiting", "running", "paused", "closed"};
    const struct session_output *o = &record->output;
    struct session_output again;
    step_ns = o->time_ns;
    if (!expected.mesh_count)
        expect_mesh(rerun_operation(rerun));
    expect_set(&record->input, o);
    expect_state(states[o->state]);
    for (int i = 0; i < EVENT_COUNT; i++)
        if (o->events & 1U << i)
            expect_text("events", o->time_ns, i == 0 ? states[o->state] : event_name(i));
    rerun_step(rerun, record, &again);
}

void expect_all(void) {
    struct trace_reader *reader;
    struct trace_record record;
    struct error err = {""};
    memset(&expected, 0, sizeof expected);
    assert_ok(trace_reader_create(served_path, &reader, &err));
    struct rerun *rerun = rerun_create(played.scene, &trace_reader_header(reader)->settings);
    rerun_watch(rerun, on_landed, rerun);
    while (strcmp(scene_case(played.scene)->groups[scene_tissue_group(played.scene, medial)].name,
                  "meniscus_medial") != 0)
        medial++;
    while (trace_read(reader, &record, &err) == RESULT_OK) {
        if (record.type == TRACE_STEP)
            expect_step(rerun, &record);
        if (record.type == TRACE_MARKER)
            expect_text("markers", record.marker.time_ns, "pulse 0.5");
        if (record.type == TRACE_REMARK)
            expect_text("remarks", record.remark.time_ns,
                        record.remark.has_marker ? "here [touch 1.0 2.2 -3.0 mm of the tibia]"
                                                 : "slower");
    }
    rerun_destroy(&rerun);
    trace_reader_destroy(&reader);
    assert_in_range(expected.set_count, 500, SETS_MAX);
    assert_in_range(expected.text_count, 8, TEXTS_MAX);
    assert_in_range(expected.mesh_count, 3, MESHES_MAX);
}

int remove_served(void **state) {
    for (int i = 0; i < expected.mesh_count; i++)
        mesh_fini(&expected.meshes[i]);
    return remove_session(state);
}
