// The messages of every pose as bytes, beside nanopb: the same bytes out, the same frames in.
#include "test.h"
#include "valid_messages.h"
#include "wire/wire.h"

#include <pb_encode.h>
#include <string.h>

// ---- replies ------------------------------------------------------------------------------------

// Often 0, now and then what is no number, and any bits else.
static float any_float(struct random *r) {
    static const float odd[] = {-0.0f, INFINITY, -INFINITY, NAN};
    uint32_t bits = (uint32_t)random_bits(r);
    float value;
    if (bits % 4 == 0)
        return 0;
    if (bits % 16 == 1)
        return odd[(bits >> 8) % 4];
    memcpy(&value, &bits, sizeof value);
    return value;
}

static double any_real(struct random *r) {
    return any_float(r) * (random_bits(r) & 1 ? 1 : 1.0 / 3);
}

// As long as any number of bits makes it.
static uint32_t any_number(struct random *r) {
    return (uint32_t)random_bits(r) >> random_bits(r) % 32;
}

static pb_size_t any_count(struct random *r, size_t most) {
    return (pb_size_t)(random_bits(r) % (most + 1));
}

#define COUNT_OF(array) (sizeof(array) / sizeof *(array))

static void fill_floats(struct random *r, float *out, size_t most, pb_size_t *out_count) {
    *out_count = any_count(r, most);
    for (size_t i = 0; i < most; i++)
        out[i] = any_float(r);
}

static arthron_Pose any_pose(struct random *r) {
    return (arthron_Pose){any_real(r), any_real(r), any_real(r), any_real(r),
                          any_real(r), any_real(r), any_real(r)};
}

static void fill_instrument(struct random *r, arthron_WarpedInstrument *out) {
    arthron_Lead *lead = &out->lead;
    out->channel = (uint8_t)any_number(r);
    out->validity = (arthron_Validity)any_count(r, 2);
    out->body = (arthron_Body)any_count(r, 2);
    out->has_pose = random_bits(r) & 1;
    out->pose = any_pose(r);
    out->trust_radius_mm = any_float(r);
    out->nearest_mm = any_float(r);
    out->has_lead = random_bits(r) & 1;
    lead->mode = (arthron_AvatarMode)any_count(r, 2);
    fill_floats(r, lead->portal, COUNT_OF(lead->portal), &lead->portal_count);
    fill_floats(r, lead->v, COUNT_OF(lead->v), &lead->v_count);
    fill_floats(r, lead->slope, COUNT_OF(lead->slope), &lead->slope_count);
    lead->s = any_float(r);
    lead->reach_mm = any_float(r);
}

static void fill_loose(struct random *r, arthron_CarriedLoose *out) {
    out->number = (uint8_t)any_number(r);
    out->state = (arthron_LooseMoment_State)any_count(r, 2);
    out->on = (uint8_t)any_number(r);
    out->has_pose = random_bits(r) & 1;
    fill_floats(r, out->pose.q, COUNT_OF(out->pose.q), &out->pose.q_count);
    fill_floats(r, out->pose.t, COUNT_OF(out->pose.t), &out->pose.t_count);
}

static arthron_Reply any_reply(struct random *r) {
    arthron_Reply reply = {.frame_number = any_number(r),
                           .frame_time_ns = -(int64_t)any_number(r),
                           .state = (arthron_SessionState)any_count(r, 3),
                           .events = any_number(r),
                           .path_challenge = random_bits(r) & 1 ? random_bits(r) : 0,
                           .has_frames_lost = random_bits(r) & 1,
                           .frames_lost = any_number(r),
                           .has_frames_late = random_bits(r) & 1,
                           .frames_late = any_number(r)};
    reply.instruments_count = any_count(r, COUNT_OF(reply.instruments));
    for (size_t i = 0; i < COUNT_OF(reply.instruments); i++)
        fill_instrument(r, &reply.instruments[i]);
    reply.corrections_count = any_count(r, COUNT_OF(reply.corrections));
    for (size_t i = 0; i < COUNT_OF(reply.corrections); i++)
        reply.corrections[i] =
            (arthron_Correction){(arthron_Body)any_count(r, 2), random_bits(r) & 1, any_pose(r)};
    reply.event_counts_count = any_count(r, COUNT_OF(reply.event_counts));
    for (size_t i = 0; i < COUNT_OF(reply.event_counts); i++)
        reply.event_counts[i] = any_number(r);
    reply.loose_count = any_count(r, COUNT_OF(reply.loose));
    for (size_t i = 0; i < COUNT_OF(reply.loose); i++)
        fill_loose(r, &reply.loose[i]);
    return reply;
}

static size_t by_nanopb(const pb_msgdesc_t *kind, const void *message, uint8_t *data, size_t size) {
    pb_ostream_t stream = pb_ostream_from_buffer(data, size);
    assert_true(pb_encode(&stream, kind, message));
    return stream.bytes_written;
}

static void assert_same_bytes(const arthron_Reply *reply) {
    uint8_t expected[arthron_Reply_size], bytes[arthron_Reply_size];
    size_t size = by_nanopb(arthron_Reply_fields, reply, expected, sizeof expected), used = 0;
    assert_int_equal(wire_encode_reply(reply, bytes, size, &used), RESULT_OK);
    assert_int_equal(used, size);
    assert_memory_equal(bytes, expected, size);
    if (size)
        assert_int_equal(wire_encode_reply(reply, bytes, size - 1, &used), RESULT_LIMIT);
}

static void a_reply_has_the_bytes_of_nanopb(void **state) {
    (void)state;
    struct random random = {23};
    for (int i = 0; i < 20000; i++) {
        arthron_Reply reply = any_reply(&random);
        assert_same_bytes(&reply);
    }
    arthron_Reply full = full_reply(), empty = {0};
    assert_same_bytes(&full);
    assert_same_bytes(&empty);
}

// ---- frames -------------------------------------------------------------------------------------

static void encode_plain(const struct frame *frame, uint8_t *data, size_t *out_size) {
    arthron_Frame message;
    wire_frame_from(frame, &message);
    *out_size = by_nanopb(arthron_Frame_fields, &message, data, arthron_Frame_size);
}

static void assert_same_frame(const struct frame *a, const struct frame *b) {
    uint8_t of_a[arthron_Frame_size], of_b[arthron_Frame_size];
    size_t a_size, b_size;
    encode_plain(a, of_a, &a_size);
    encode_plain(b, of_b, &b_size);
    assert_int_equal(a_size, b_size);
    assert_memory_equal(of_a, of_b, a_size);
}

// Returns whether it is a good frame.
static bool assert_read_as_by_nanopb(const uint8_t *data, size_t size) {
    arthron_Frame message;
    struct frame expected, frame;
    struct error err = {""}, expected_err = {""};
    enum result expected_result = wire_decode_frame(data, size, &message, &expected_err);
    if (expected_result == RESULT_OK)
        expected_result = wire_frame_to(&message, &expected, &expected_err);
    memset(&frame, 0xa5, sizeof frame);
    assert_int_equal(wire_read_frame(data, size, &frame, &err), expected_result);
    assert_string_equal(err.text, expected_err.text);
    if (expected_result == RESULT_INVALID)
        assert_int_equal(frame.number, message.number);
    if (expected_result == RESULT_OK)
        assert_same_frame(&frame, &expected);
    return expected_result == RESULT_OK;
}

static size_t any_frame(struct random *random, uint8_t *data) {
    struct frame frame = make_frame(random, (int)any_count(random, FRAME_SAMPLES_MAX));
    arthron_Frame message;
    wire_frame_from(&frame, &message);
    if (random_bits(random) & 1)
        wire_frame_pad(&message);
    return by_nanopb(arthron_Frame_fields, &message, data, arthron_Frame_size);
}

static void a_good_frame_is_read_as_by_nanopb(void **state) {
    (void)state;
    struct random random = {29};
    uint8_t data[arthron_Frame_size];
    for (int i = 0; i < 5000; i++) {
        size_t size = any_frame(&random, data);
        if (size <= WIRE_DATAGRAM_MAX)
            assert_true(assert_read_as_by_nanopb(data, size));
    }
}

// A byte is another one, gone, or there twice; or the end is missing.
static size_t spoil(struct random *random, uint8_t *data, size_t size) {
    size_t at = (size_t)(random_bits(random) % size);
    switch (random_bits(random) % 5) {
    case 0:
        data[at] = (uint8_t)random_bits(random);
        return size;
    case 1:
        data[at] ^= (uint8_t)(1 << random_bits(random) % 8);
        return size;
    case 2:
        memmove(data + at, data + at + 1, size - at - 1);
        return size - 1;
    case 3:
        memmove(data + at + 1, data + at, size - at);
        return size + 1;
    default:
        return at;
    }
}

static void a_spoilt_frame_is_read_as_by_nanopb(void **state) {
    (void)state;
    struct random random = {31};
    uint8_t data[arthron_Frame_size + 8];
    int good = 0;
    for (int i = 0; i < 100000; i++) {
        size_t size = any_frame(&random, data);
        for (uint64_t k = 1 + random_bits(&random) % 3; k && size; k--)
            size = spoil(&random, data, size);
        good += assert_read_as_by_nanopb(data, size);
    }
    assert_true(good > 10000 && good < 90000);
}

// Whatever the format allows: fields in another order, twice, unknown, longer than need be.
static void an_odd_encoding_is_read_as_by_nanopb(void **state) {
    (void)state;
    static const struct {
        const char *bytes;
        size_t size;
    } rows[] = {
#define ROW(text) {text, sizeof text - 1}
        ROW(""),
        ROW("\x09\1\0\0\0\0\0\0\0"),                                       // no time
        ROW("\x11\1\0\0\0\0\0\0\0\x09\1\0\0\0\0\0\0\0"),                   // time first
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x1a\2\x3a\0"),       // an empty handle
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x1a\2\x32\0"),       // an empty pose
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x1a\3\x3a\x80\0"),   // a long length
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x1a\4\x10\1\x2a\0"), // held
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x1a\4\x2a\0\x10\1"), // the same, behind it
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x1a\4\x2a\0\x3a\0"), // two values
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x1a\6\x2a\0\x40\xff\xff\3"),
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x1a\6\x2a\0\x40\x80\x80\4"),
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x22\0"),
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x22\1"),
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\x28\1"), // an unknown field
        ROW("\x09\1\0\0\0\0\0\0\0\x11\1\0\0\0\0\0\0\0\0"),
#undef ROW
    };
    for (size_t i = 0; i < COUNT_OF(rows); i++)
        assert_read_as_by_nanopb((const uint8_t *)rows[i].bytes, rows[i].size);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_reply_has_the_bytes_of_nanopb),
        cmocka_unit_test(a_good_frame_is_read_as_by_nanopb),
        cmocka_unit_test(a_spoilt_frame_is_read_as_by_nanopb),
        cmocka_unit_test(an_odd_encoding_is_read_as_by_nanopb),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
