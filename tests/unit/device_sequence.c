// Sequence metafiles of PlusLib, as its documentation describes them:
// https://pluslib.readthedocs.io/en/latest/file-formats/FileSequenceFile.html

#include "base/clock.h"
#include "drivers/drivers.h"
#include "drivers/recording.h"
#include "in_folder.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

#define HEADER                                                                                     \
    "ObjectType = Image\nNDims = 3\nAnatomicalOrientation = RAI\nBinaryData = True\n"              \
    "BinaryDataByteOrderMSB = False\nCenterOfRotation = 0 0 0\nCompressedData = False\n"           \
    "DimSize = 2 2 3\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\nOffset = 0 0 0\n"           \
    "TransformMatrix = 1 0 0 0 1 0 0 0 1\nUltrasoundImageOrientation = MFA\n"                      \
    "Kinds = domain domain list\n"
#define END "ElementDataFile = LOCAL\n"
#define PLACE "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
#define TURNED "0 -1 0 10.5 1 0 0 -20 0 0 1 30 0 0 0 1" // by 90 degrees about z
#define FRAME(n, t)                                                                                \
    "Seq_Frame000" #n "_FrameNumber = " #n "\nSeq_Frame000" #n "_Timestamp = " t "\n"
#define TOOL(n, name, matrix, status)                                                              \
    "Seq_Frame000" #n "_" name "Transform = " matrix "\nSeq_Frame000" #n "_" name                  \
    "TransformStatus = " status "\n"

static const char *written_bytes(const char *text, size_t size) {
    static char path[128];
    snprintf(path, sizeof path, "%s/a.igs.mha", folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_int_equal(size, fwrite(text, 1, size, file));
    fclose(file);
    return path;
}

static const char *written(const char *text) {
    return written_bytes(text, strlen(text));
}

static const char session[] = HEADER FRAME(0, "11.25") TOOL(0, "ProbeToTracker", TURNED, "OK")
    TOOL(0, "ReferenceToTracker", PLACE, "OK")
        TOOL(0, "ImageToProbe", "2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1", "OK") FRAME(1, "11.5")
            TOOL(1, "ProbeToTracker", PLACE, "INVALID")
                TOOL(1, "ReferenceToTracker", PLACE,
                     "OK") "Seq_Frame0001_ImageStatus = OK\n" FRAME(2, "12.0")
                    TOOL(2, "ReferenceToTracker", TURNED, "OK") END "\0\xffpixels\nSeq_Frame";

static void assert_turned(const struct recording_state *state) {
    assert_true(state->valid);
    assert_vec3_near(state->pose.translation, ((vec3){10.5, -20, 30}), 0);
    vec3 x = quat_rotate(state->pose.rotation, (vec3){1, 0, 0});
    assert_vec3_near(x, ((vec3){0, 1, 0}), 1e-12);
}

static void frames_have_their_times_and_their_poses(void **state) {
    (void)state;
    struct recording r;
    struct error err;
    assert_ok(recording_read(written_bytes(session, sizeof session - 1), CHANNEL_COUNT, &r, &err));
    assert_int_equal(3, r.row_count);
    assert_null(r.joints);
    assert_int_equal(1, r.tool_count);
    assert_int_equal(CHANNEL_PROBE, r.tools[0].channel);
    assert_false(r.tools[0].has_opening);
    assert_near(r.t_seconds[0], 11.25, 0);
    assert_near(r.t_seconds[2], 12, 0);
    assert_turned(&r.tools[0].states[0]);
    assert_false(r.tools[0].states[1].valid); // its status
    assert_false(r.tools[0].states[2].valid); // it is not there
    assert_true(pose_is_valid(r.tools[0].states[2].pose));
    recording_fini(&r);
}

static void tools_are_those_that_are_named(void **state) {
    (void)state;
    struct recording r;
    struct error err;
    const struct recording_tools tools = {
        .unnamed = CHANNEL_COUNT,
        .names = {[CHANNEL_PUNCH] = "ProbeToTracker", [CHANNEL_TIBIA] = "Reference"}};
    const char *path = written_bytes(session, sizeof session - 1);
    assert_ok(recording_read_tools(path, &tools, &r, &err));
    assert_int_equal(2, r.tool_count);
    assert_int_equal(CHANNEL_PUNCH, r.tools[0].channel);
    assert_int_equal(CHANNEL_TIBIA, r.tools[1].channel);
    assert_turned(&r.tools[1].states[2]);
    recording_fini(&r);
    const struct recording_tools scaled = {.unnamed = CHANNEL_COUNT,
                                           .names = {[CHANNEL_PUNCH] = "ImageToProbe"}};
    assert_int_equal(RESULT_FORMAT, recording_read_tools(path, &scaled, &r, &err));
    assert_non_null(strstr(err.text, "frame 0: ImageToProbe is not a rotation and a translation"));
    recording_fini(&r);
    const struct recording_tools absent = {.unnamed = CHANNEL_COUNT,
                                           .names = {[CHANNEL_KNIFE] = "Knife"}};
    assert_int_equal(RESULT_FORMAT, recording_read_tools(path, &absent, &r, &err));
    assert_non_null(
        strstr(err.text, "has no transform Knife; others: ProbeToTracker, ReferenceToTracker"));
    recording_fini(&r);
}

// With Windows' ends of lines, ten digits, no status, and a tool that comes later.
static void the_one_tool_of_a_recording_needs_no_name(void **state) {
    (void)state;
    struct recording r;
    struct error err;
    const char *path =
        written("ObjectType = Image\r\nSeq_Frame0000000000_Timestamp = 1e-1\r\n"
                "Seq_Frame0000000001_StylusToTrackerTransform = " TURNED "\r\n"
                "Seq_Frame0000000001_Timestamp = 2e-1 \r\nElementDataFile = a.raw\r\n");
    assert_ok(recording_read(path, CHANNEL_SCOPE, &r, &err));
    assert_int_equal(2, r.row_count);
    assert_int_equal(CHANNEL_SCOPE, r.tools[0].channel);
    assert_false(r.tools[0].states[0].valid);
    assert_turned(&r.tools[0].states[1]);
    recording_fini(&r);
}

// Six digits, and zeros with a sign.
static void a_matrix_is_as_exact_as_its_digits(void **state) {
    (void)state;
    struct recording r;
    struct error err;
    const char *path = written(HEADER FRAME(0, "7417.731300") TOOL(
        0, "ProbeToTracker",
        "0.866025 -0.5 -0 199.132 0.5 0.866025 0 -30.1377 -0 0 1 7e-005 -0 0 -0 1", "OK") END);
    assert_ok(recording_read(path, CHANNEL_COUNT, &r, &err));
    assert_near(quat_angle(r.tools[0].states[0].pose.rotation, quat_identity()) / RAD_PER_DEG, 30,
                1e-4);
    assert_vec3_near(r.tools[0].states[0].pose.translation, ((vec3){199.132, -30.1377, 7e-5}), 0);
    recording_fini(&r);
}

static void a_pose_that_is_not_a_number_is_not_valid(void **state) {
    (void)state;
    struct recording r;
    struct error err;
    const char *path =
        written(HEADER FRAME(0, "0")
                    TOOL(0, "ProbeToTracker", "nan nan nan nan 0 0 0 0 0 0 0 0 0 0 0 1", "OK")
                        FRAME(1, "1") TOOL(1, "ProbeToTracker", TURNED, "OK") END);
    assert_ok(recording_read(path, CHANNEL_COUNT, &r, &err));
    assert_false(r.tools[0].states[0].valid);
    assert_turned(&r.tools[0].states[1]);
    recording_fini(&r);
}

#define PROBE(n) TOOL(n, "ProbeToTracker", PLACE, "OK")

static void files_that_are_wrong_are_refused_with_their_place(void **state) {
    (void)state;
    static const struct {
        const char *text, *says;
        enum channel unnamed;
    } rows[] = {
        {"ObjectType = Mesh\n" END, ":1: ObjectType is not Image", CHANNEL_COUNT},
        {"ObjectType", ":1: a line is NAME = VALUE", CHANNEL_COUNT},
        {HEADER, "ends before ElementDataFile", CHANNEL_COUNT},
        {HEADER END, "has no frames", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") END, "no transform is called as a channel", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") TOOL(0, "StylusToTracker", PLACE, "OK") END,
         "must name one of StylusToTracker", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") PROBE(0) TOOL(0, "StylusToTracker", PLACE, "OK") END,
         ":19: both ProbeToTracker and StylusToTracker are the probe: tool.probe must name one",
         CHANNEL_PROBE},
        {HEADER PROBE(0) END, "frame 0 has no Timestamp", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") PROBE(0) PROBE(1) END, "frame 1 has no Timestamp", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") PROBE(0) FRAME(1, "1") END, "frame 1: the time 1 does not follow 1",
         CHANNEL_COUNT},
        {HEADER FRAME(1, "1") END, ":15: frame 1 does not follow 0 frames", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") "Seq_Frame99999999999999999999999_Timestamp = 2\n" END,
         "does not follow 1 frames", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") FRAME(1, "2") FRAME(0, "3") END, ":19: frame 0 does not follow 2",
         CHANNEL_COUNT},
        {HEADER "Seq_Framex_Timestamp = 1\n" END, ":15: a frame has no number", CHANNEL_COUNT},
        {HEADER "Seq_Frame0000 = 1\n" END, ":15: a field of a frame has no name", CHANNEL_COUNT},
        {HEADER "Seq_Frame0000_Timestamp = soon\n" END, ":15: Timestamp: no number", CHANNEL_COUNT},
        {HEADER "Seq_Frame0000_Timestamp = inf\n" END, ":15: Timestamp: no number", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") TOOL(0, "ProbeToTracker", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0", "OK") END,
         ":17: a matrix has 16 numbers", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") TOOL(0, "ProbeToTracker", PLACE " 1", "OK") END,
         ":17: a matrix has 16 numbers", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") TOOL(0, "ProbeToTracker", "-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "OK")
             END,
         "ProbeToTracker is not a rotation and a translation", CHANNEL_COUNT},
        {HEADER FRAME(0, "1") TOOL(0, "ProbeToTracker", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2", "OK")
             END,
         "ProbeToTracker is not a rotation and a translation", CHANNEL_COUNT},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct recording r;
        struct error err = {{0}};
        const char *path = written(rows[i].text);
        if (recording_read(path, rows[i].unnamed, &r, &err) == RESULT_OK)
            fail_msg("row %zu was read", i);
        if (!strstr(err.text, rows[i].says) || !strstr(err.text, path))
            fail_msg("row %zu: \"%s\" does not say \"%s\"", i, err.text, rows[i].says);
        recording_fini(&r);
    }
}

static void a_line_without_end_is_refused(void **state) {
    (void)state;
    static char text[20000] = "ObjectType = ";
    struct recording r;
    struct error err;
    memset(text + strlen(text), 'x', sizeof text - 1 - strlen(text));
    assert_int_equal(RESULT_LIMIT, recording_read(written(text), CHANNEL_COUNT, &r, &err));
    assert_non_null(strstr(err.text, "longer than 8191 bytes"));
    recording_fini(&r);
}

static void *created(const struct device_config *config) {
    struct device_outputs outputs = {0};
    struct error err;
    void *device = NULL;
    assert_ok(recorded_driver.create(config, &device, &outputs, &err));
    assert_int_equal(1, outputs.count);
    assert_ok(recorded_driver.open(device, &err));
    return device;
}

// p_mockup = T_mockup_tracker · ProbeToTracker · T_tool_tip · p_tip.
static void a_metafile_is_played_as_a_device(void **state) {
    (void)state;
    const struct device_option options[] = {{"file", written_bytes(session, sizeof session - 1)},
                                            {"tool.scope", "Probe"},
                                            {"T_mockup_tracker", "100 0 0 1 0 0 0"},
                                            {"tip.scope", "0 5 0 1 0 0 0"}};
    const struct device_config config = {"hand", options, sizeof options / sizeof *options};
    void *device = created(&config);
    struct error err;
    enum validity validities[2] = {VALIDITY_COUNT, VALIDITY_COUNT};
    for (int i = 0; i < 2;) {
        struct device_reading reading = {0};
        assert_ok(recorded_driver.poll(device, &reading, &err));
        if (!reading.count)
            continue;
        assert_int_equal(CHANNEL_SCOPE, reading.samples[0].channel);
        if (i == 0)
            assert_vec3_near(reading.samples[0].T_mockup_body.translation, ((vec3){105.5, -20, 30}),
                             1e-12);
        validities[i++] = reading.samples[0].validity;
    }
    assert_int_equal(VALIDITY_OK, validities[0]);
    assert_int_equal(VALIDITY_LOST, validities[1]);
    recorded_driver.destroy(device);
}

static void a_table_has_no_transforms(void **state) {
    (void)state;
    struct recording r;
    struct error err;
    const struct recording_tools tools = {.unnamed = CHANNEL_COUNT,
                                          .names = {[CHANNEL_PUNCH] = "Probe"}};
    const char *path = written("t_seconds,flexion_deg\n");
    assert_int_equal(RESULT_INVALID, recording_read_tools(path, &tools, &r, &err));
    assert_non_null(strstr(err.text, "is a table; tool.punch is for metafiles alone"));
    recording_fini(&r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_have_their_times_and_their_poses),
        cmocka_unit_test(tools_are_those_that_are_named),
        cmocka_unit_test(the_one_tool_of_a_recording_needs_no_name),
        cmocka_unit_test(a_matrix_is_as_exact_as_its_digits),
        cmocka_unit_test(a_pose_that_is_not_a_number_is_not_valid),
        cmocka_unit_test(files_that_are_wrong_are_refused_with_their_place),
        cmocka_unit_test(a_line_without_end_is_refused),
        cmocka_unit_test(a_metafile_is_played_as_a_device),
        cmocka_unit_test(a_table_has_no_transforms),
    };
    return cmocka_run_group_tests_name("sequence metafiles", tests, make_folder, remove_folder);
}
