// What the room writes, beside the bytes of other people's messages.

#include "igtl/content.h"
#include "openigtlink_stream.h"
#include "test.h"

#include <openigtlink/igtl_transform.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint8_t out[1 << 16];

static size_t write_message(const struct igtl_head *head, const void *content, size_t size) {
    memcpy(out + igtl_message_content(head->version), content, size);
    assert_true(igtl_message_size(head, size) <= sizeof out);
    return igtl_message_finish(head, size, out);
}

static bool load(const char *name, struct bytes *bytes) {
    const char *data = getenv("ARTHRON_DATA");
    char path[512];
    snprintf(path, sizeof path, "%s/protocol/openigtlink/%s", data ? data : DATA, name);
    FILE *file = fopen(path, "rb");
    if (!file)
        return false;
    bytes->size = fread(bytes->data, 1, sizeof bytes->data, file);
    fclose(file);
    return true;
}

static void assert_bytes(const char *name, const uint8_t *want, const uint8_t *got, size_t size) {
    for (size_t i = 0; i < size; i++)
        if (got[i] != want[i])
            fail_msg("%s: byte %zu is %02x, not %02x", name, i, got[i], want[i]);
}

static void assert_same(const char *name, size_t size) {
    static struct bytes want;
    assert_true(load(name, &want));
    assert_int_equal(want.size, size);
    assert_bytes(name, want.data, out, size);
}

static const uint64_t stamp = 0x499602d4; // of all of them

static struct igtl_head head_of(int version, const char *type) {
    return (struct igtl_head){
        .version = version, .type = type, .device = "DeviceName", .stamp = stamp};
}

// The message as it came, and its content.
static struct igtl_frame frame_of(const char *name, struct igtl_content *content) {
    static struct bytes bytes;
    static struct igtl_framing framing;
    enum igtl_framing_event event;
    struct igtl_frame frame;
    struct error err;
    assert_true(load(name, &bytes));
    igtl_framing_init(&framing);
    assert_int_equal(bytes.size,
                     igtl_framing_feed(&framing, bytes.data, bytes.size, &event, &frame, &err));
    assert_int_equal(IGTL_FRAMING_MESSAGE, event);
    assert_true(frame.intact);
    assert_ok(igtl_frame_content(&frame, content, &err));
    return frame;
}

static pose pose_of(const char *name, int tool) {
    static struct bytes bytes;
    assert_true(load(name, &bytes));
    struct report r = report_of(&bytes);
    assert_true(tool < r.last.count);
    return r.last.tools[tool].T_tracker_tool;
}

static void texts_have_the_bytes_of_other_peoples_messages(void **state) {
    (void)state;
    uint8_t content[512];
    struct igtl_head status = head_of(1, "STATUS"), string = head_of(1, "STRING");
    size_t size =
        igtl_write_status(15, 10, "ACTUATOR_DISABLED", "Actuator A is disabled.", content);
    assert_same("status_v1.bin", write_message(&status, content, size));
    size = igtl_write_string("Welcome to OpenIGTLink", content);
    assert_same("string_v1.bin", write_message(&string, content, size));
}

static void all_around_a_content_has_the_bytes_of_other_peoples_messages(void **state) {
    (void)state;
    static const char *const names[] = {"image_v1.bin",    "point_v1.bin",      "polydata_v1.bin",
                                        "position_v1.bin", "status_v1.bin",     "string_v1.bin",
                                        "tdata_v1.bin",    "trajectory_v1.bin", "transform_v1.bin"};
    struct igtl_content content;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        struct igtl_frame frame = frame_of(names[i], &content);
        struct igtl_head head = head_of(1, frame.type);
        assert_same(names[i], write_message(&head, content.bytes, content.size));
    }
}

static void metadata_has_the_bytes_of_other_peoples_messages(void **state) {
    (void)state;
    static const struct igtl_metadata ages[] = {{"First patient age", "22"},
                                                {"Second patient age", "25"}};
    struct igtl_content content;
    frame_of("transform_v2.bin", &content);
    struct igtl_head head = head_of(2, "TRANSFORM");
    head.id = 1;
    head.metadata_count = 2;
    head.metadata = ages;
    assert_same("transform_v2.bin", write_message(&head, content.bytes, content.size));
    frame_of("command_v2.bin", &content);
    head.type = "COMMAND";
    head.device = "OpticalTracker";
    head.stamp = 0;
    assert_same("command_v2.bin", write_message(&head, content.bytes, content.size));
}

// Their matrices are no rotations to the last bit of a float, so 9 of the 12 elements are compared
// as numbers.
static void assert_matrix(const uint8_t *want, const uint8_t *got) {
    float a[12], b[12];
    memcpy(a, want, sizeof a);
    memcpy(b, got, sizeof b);
    igtl_transform_convert_byte_order(a);
    igtl_transform_convert_byte_order(b);
    for (int i = 0; i < 12; i++)
        assert_near(a[i], b[i], i < 9 ? 1e-6 : 0);
}

static void poses_have_the_elements_of_other_peoples_messages(void **state) {
    (void)state;
    enum { NAME_AND_TYPE = 22 };
    struct igtl_content content;
    uint8_t ours[IGTL_TDATA_SIZE];
    frame_of("transform_v1.bin", &content);
    assert_int_equal(content.size, igtl_write_transform(pose_of("transform_v1.bin", 0), ours));
    assert_matrix(content.bytes, ours);
    frame_of("tdata_v1.bin", &content);
    assert_int_equal(3 * IGTL_TDATA_SIZE, content.size);
    for (int i = 0; i < 3; i++) {
        const uint8_t *theirs = content.bytes + i * IGTL_TDATA_SIZE;
        char name[16];
        snprintf(name, sizeof name, "Tracker%d", i);
        assert_int_equal(IGTL_TDATA_SIZE, igtl_write_tdata(name, pose_of("tdata_v1.bin", i), ours));
        assert_bytes(name, theirs, ours, NAME_AND_TYPE);
        assert_matrix(theirs + NAME_AND_TYPE, ours + NAME_AND_TYPE);
    }
}

// A position with a quaternion of length 1, which theirs has not: its direction is compared.
static void a_position_has_the_numbers_of_other_peoples_message(void **state) {
    (void)state;
    struct igtl_content content;
    uint8_t ours[IGTL_POSITION_SIZE];
    frame_of("position_v1.bin", &content);
    assert_int_equal(content.size, igtl_write_position(pose_of("position_v1.bin", 0), ours));
    assert_bytes("position_v1.bin", content.bytes, ours, 12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(texts_have_the_bytes_of_other_peoples_messages),
        cmocka_unit_test(all_around_a_content_has_the_bytes_of_other_peoples_messages),
        cmocka_unit_test(metadata_has_the_bytes_of_other_peoples_messages),
        cmocka_unit_test(poses_have_the_elements_of_other_peoples_messages),
        cmocka_unit_test(a_position_has_the_numbers_of_other_peoples_message),
    };
    static struct bytes bytes;
    if (!load("string_v1.bin", &bytes)) {
        printf("skipped: no shared data (ARTHRON_DATA)\n");
        return 77;
    }
    return cmocka_run_group_tests_name("igtl_vectors", tests, NULL, NULL);
}
