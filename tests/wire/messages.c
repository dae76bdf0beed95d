// Messages as bytes: every kind there and back, and malformed ones, which are refused without harm
// (the sanitizers see what harm there is: every input lies in memory of just its size).
#include "message_rows.h"
#include "random.h"
#include "test.h"
#include "wire/seal.h"
#include "wire/valid_messages.h"
#include "wire/wire.h"

#include <pb_encode.h>
#include <stdlib.h>
#include <string.h>

// ---- each kind of message -----------------------------------------------------------------------

struct kind {
    const char *name;
    size_t message_size;
    enum result (*encode)(const void *, uint8_t *, size_t, size_t *);
    enum result (*decode)(const uint8_t *, size_t, void *, struct error *);
};

static enum result encode_control(const void *m, uint8_t *data, size_t size, size_t *out_used) {
    return wire_encode_control(m, data, size, out_used);
}

static enum result encode_console(const void *m, uint8_t *data, size_t size, size_t *out_used) {
    return wire_encode_console(m, data, size, out_used);
}

static enum result encode_frame(const void *m, uint8_t *data, size_t size, size_t *out_used) {
    return wire_encode_frame(m, data, size, out_used);
}

static enum result encode_reply(const void *m, uint8_t *data, size_t size, size_t *out_used) {
    return wire_encode_reply(m, data, size, out_used);
}

static enum result decode_control(const uint8_t *data, size_t size, void *out, struct error *err) {
    return wire_decode_control(data, size, out, err);
}

static enum result decode_console(const uint8_t *data, size_t size, void *out, struct error *err) {
    return wire_decode_console(data, size, out, err);
}

static enum result decode_frame(const uint8_t *data, size_t size, void *out, struct error *err) {
    return wire_decode_frame(data, size, out, err);
}

static enum result decode_reply(const uint8_t *data, size_t size, void *out, struct error *err) {
    return wire_decode_reply(data, size, out, err);
}

static enum result encode_page(const void *message, uint8_t *data, size_t size, size_t *out_used) {
    pb_ostream_t stream = pb_ostream_from_buffer(data, size);
    bool fits = pb_encode(&stream, arthron_Page_fields, message);
    *out_used = stream.bytes_written;
    return fits ? RESULT_OK : RESULT_LIMIT;
}

static enum result decode_page(const uint8_t *data, size_t size, void *out, struct error *err) {
    return wire_decode_page(data, size, out, err);
}

static const struct kind kinds[] = {
    [KIND_CONTROL] = {"control", sizeof(arthron_Control), encode_control, decode_control},
    [KIND_CONSOLE] = {"console", sizeof(arthron_Console), encode_console, decode_console},
    [KIND_FRAME] = {"frame", sizeof(arthron_Frame), encode_frame, decode_frame},
    [KIND_REPLY] = {"reply", sizeof(arthron_Reply), encode_reply, decode_reply},
    [KIND_PAGE] = {"page's", sizeof(arthron_Page), encode_page, decode_page},
};

#define KIND_COUNT (sizeof kinds / sizeof *kinds)
#define BYTES_MAX WIRE_CONSOLE_MAX

// A valid message as bytes.
struct valid {
    int kind;
    size_t size;
    uint8_t *bytes;
};

static struct valid encoded(int kind, const void *message) {
    uint8_t *bytes = malloc(BYTES_MAX);
    size_t size = 0;
    assert_int_equal(kinds[kind].encode(message, bytes, BYTES_MAX, &size), RESULT_OK);
    return (struct valid){kind, size, bytes};
}

static enum result decode_copy(int kind, const uint8_t *bytes, size_t size, void *out,
                               struct error *err) {
    uint8_t *exact = malloc(size ? size : 1);
    memcpy(exact, bytes, size);
    enum result result = kinds[kind].decode(exact, size, out, err);
    free(exact);
    return result;
}

// ---- valid messages -----------------------------------------------------------------------------

#define VALID_MAX 26

static int all_valid(struct valid out[VALID_MAX]) {
    int count = 0;
    arthron_Control *control = malloc(sizeof *control);
    for (int which = arthron_Control_hello_tag; which <= arthron_Control_mesh_ack_tag; which++) {
        fill_control(which, control);
        out[count++] = encoded(KIND_CONTROL, control);
    }
    for (int which = arthron_Control_marker_tag; which <= arthron_Control_moved_tag; which++) {
        fill_control(which, control);
        out[count++] = encoded(KIND_CONTROL, control);
    }
    out[count++] = encoded(KIND_REPLY, &(arthron_Reply){0});
    arthron_Reply reply = full_reply();
    out[count++] = encoded(KIND_REPLY, &reply);
    fill_control(arthron_Control_frame_tag, control);
    out[count++] = encoded(KIND_FRAME, &control->message.frame);
    free(control);
    arthron_Console *console = malloc(sizeof *console);
    for (int which = 1; which <= arthron_Console_metrics_tag; which++) {
        fill_console(which, console);
        out[count++] = encoded(KIND_CONSOLE, console);
    }
    free(console);
    return count;
}

static void release_all(struct valid *valid, int count) {
    for (int i = 0; i < count; i++)
        free(valid[i].bytes);
}

// ---- there and back -----------------------------------------------------------------------------

static void every_message_comes_back_as_it_went(void **state) {
    (void)state;
    struct valid valid[VALID_MAX];
    int count = all_valid(valid);
    void *message = malloc(sizeof(arthron_Console));
    for (int i = 0; i < count; i++) {
        assert_int_equal(decode_copy(valid[i].kind, valid[i].bytes, valid[i].size, message, NULL),
                         RESULT_OK);
        struct valid again = encoded(valid[i].kind, message);
        assert_int_equal(again.size, valid[i].size);
        assert_memory_equal(again.bytes, valid[i].bytes, again.size);
        free(again.bytes);
    }
    free(message);
    release_all(valid, count);
}

static void a_buffer_one_byte_too_short_is_refused(void **state) {
    (void)state;
    struct valid valid[VALID_MAX];
    int count = all_valid(valid);
    void *message = malloc(sizeof(arthron_Console));
    for (int i = 0; i < count; i++) {
        decode_copy(valid[i].kind, valid[i].bytes, valid[i].size, message, NULL);
        size_t used, size = valid[i].size;
        if (!size)
            continue;
        uint8_t *data = malloc(size);
        assert_int_equal(kinds[valid[i].kind].encode(message, data, size, &used), RESULT_OK);
        assert_int_equal(kinds[valid[i].kind].encode(message, data, size - 1, &used), RESULT_LIMIT);
        free(data);
    }
    free(message);
    release_all(valid, count);
}

static void assert_same_sample(const struct sample *a, const struct sample *b) {
    assert_int_equal(a->channel, b->channel);
    assert_int_equal(a->kind, b->kind);
    assert_int_equal(a->validity, b->validity);
    assert_int_equal(a->device, b->device);
    assert_int_equal(a->filter, b->filter);
    assert_int_equal(a->filter_latency_us, b->filter_latency_us);
    assert_int_equal(a->time_ns, b->time_ns);
    if (a->kind == SAMPLE_JOINT)
        assert_memory_equal(&a->joint, &b->joint, sizeof a->joint);
    else if (a->kind == SAMPLE_POSE)
        assert_memory_equal(&a->T_mockup_body, &b->T_mockup_body, sizeof a->T_mockup_body);
    else if (a->kind == SAMPLE_FORCE)
        assert_true(a->force_n == b->force_n);
    else
        assert_true(a->handle.opening == b->handle.opening &&
                    a->handle.buttons == b->handle.buttons);
}

static void a_frame_comes_back_bit_for_bit(void **state) {
    (void)state;
    struct random random = {11};
    for (int i = 0; i < 200; i++) {
        struct frame frame = make_frame(&random, i % (FRAME_SAMPLES_MAX + 1)), back;
        arthron_Frame message;
        wire_frame_from(&frame, &message);
        struct valid bytes = encoded(KIND_FRAME, &message);
        assert_int_equal(decode_copy(KIND_FRAME, bytes.bytes, bytes.size, &message, NULL), 0);
        assert_int_equal(wire_frame_to(&message, &back, NULL), RESULT_OK);
        free(bytes.bytes);
        assert_int_equal(back.number, frame.number);
        assert_int_equal(back.time_ns, frame.time_ns);
        assert_int_equal(back.count, frame.count);
        for (int k = 0; k < frame.count; k++)
            assert_same_sample(&back.samples[k], &frame.samples[k]);
    }
}

// What each server of before takes: the frame as it was, without what it would refuse.
static void assert_reduced(const struct frame *frame, bool instruments, bool force) {
    arthron_Frame message;
    struct frame back;
    int kept = 0, left = 0;
    wire_frame_from(frame, &message);
    bool all = wire_frame_reduce(&message, instruments, force);
    assert_int_equal(wire_frame_to(&message, &back, NULL), RESULT_OK);
    for (int i = 0; i < frame->count; i++) {
        const struct sample *s = &frame->samples[i];
        if (!instruments && s->channel > CHANNEL_SCOPE)
            continue;
        if (!force && (s->kind == SAMPLE_FORCE || kept == 16))
            left++;
        else
            assert_same_sample(&back.samples[kept++], s);
    }
    assert_int_equal(back.count, kept);
    assert_int_equal(all, left == 0);
}

static void an_older_server_gets_no_more_than_it_takes(void **state) {
    (void)state;
    struct random random = {17};
    for (int i = 0; i < 400; i++) {
        struct frame frame = make_frame(&random, i % (FRAME_SAMPLES_MAX + 1));
        assert_reduced(&frame, i & 1, i & 2);
    }
}

// ---- padding ------------------------------------------------------------------------------------

static void a_padded_frame_is_never_shorter_than_the_longest_reply_to_it(void **state) {
    (void)state;
    struct random random = {5};
    for (int i = 0; i < 2000; i++) {
        struct frame frame =
            make_frame(&random, (int)(random_bits(&random) % (FRAME_SAMPLES_MAX + 1)));
        frame.number = random_bits(&random) % 2; // 0 takes no room
        arthron_Frame message;
        wire_frame_from(&frame, &message);
        wire_frame_pad(&message);
        bool there[CHANNEL_COUNT] = {false};
        for (int k = 0; k < frame.count; k++)
            there[frame.samples[k].channel] = true;
        arthron_Reply reply = longest_reply(there);
        struct valid asked = encoded(KIND_FRAME, &message), answer = encoded(KIND_REPLY, &reply);
        assert_true(asked.size >= answer.size);
        assert_true(asked.size + SEAL_OVERHEAD <= WIRE_DATAGRAM_MAX);
        wire_frame_pad(&message); // again: the same
        struct valid again = encoded(KIND_FRAME, &message);
        assert_int_equal(again.size, asked.size);
        free(asked.bytes), free(answer.bytes), free(again.bytes);
    }
}

// ---- malformed ----------------------------------------------------------------------------------

static void assert_terminated(const char *text, size_t size) {
    assert_non_null(memchr(text, 0, size));
}

// What wire.h promises of a message that was decoded.
static void assert_is_usable(int kind, const void *message) {
    const arthron_Control *control = message;
    const arthron_Console *console = message;
    const arthron_Frame *frame = kind == KIND_FRAME ? message : &control->message.frame;
    struct frame plain;
    if (kind == KIND_FRAME ||
        (kind == KIND_CONTROL && control->which_message == arthron_Control_frame_tag)) {
        assert_true(frame->samples_count <= FRAME_SAMPLES_MAX);
        if (wire_frame_to(frame, &plain, NULL) == RESULT_OK)
            assert_true(frame_is_valid(&plain));
    }
    if (kind == KIND_CONTROL && control->which_message == arthron_Control_hello_tag) {
        const arthron_Hello *hello = &control->message.hello;
        assert_terminated(hello->station, sizeof hello->station);
        assert_true(hello->devices_count <= WIRE_DEVICES_MAX && hello->capabilities_count <= 16);
    }
    if (kind == KIND_CONSOLE && console->which_message == arthron_Console_command_reply_tag) {
        const arthron_CommandReply *reply = &console->message.command_reply;
        assert_terminated(reply->text, sizeof reply->text);
        assert_true(reply->sessions_count <= 64);
    }
}

static void try_all_decoders(const uint8_t *bytes, size_t size, void *message) {
    for (int kind = 0; kind < (int)KIND_COUNT; kind++) {
        struct error err = {"nothing"};
        enum result result = decode_copy(kind, bytes, size, message, &err);
        if (result == RESULT_OK) {
            assert_is_usable(kind, message);
        } else {
            assert_int_equal(result, size > WIRE_DATAGRAM_MAX ? result : RESULT_FORMAT);
            assert_non_null(strstr(err.text, kinds[kind].name));
        }
    }
}

static void truncations_at_every_byte_do_no_harm(void **state) {
    (void)state;
    struct valid valid[VALID_MAX];
    int count = all_valid(valid);
    void *message = malloc(sizeof(arthron_Console));
    for (int i = 0; i < count; i++)
        for (size_t size = 0; size < valid[i].size; size++) {
            enum result result = decode_copy(valid[i].kind, valid[i].bytes, size, message, NULL);
            // All of a control or console message is one field: any part of it is malformed.
            if (size && (valid[i].kind == KIND_CONTROL || valid[i].kind == KIND_CONSOLE))
                assert_int_equal(result, RESULT_FORMAT);
            else if (result == RESULT_OK)
                assert_is_usable(valid[i].kind, message);
        }
    free(message);
    release_all(valid, count);
}

static void random_changes_do_no_harm(void **state) {
    (void)state;
    struct random random = {2026};
    struct valid valid[VALID_MAX];
    int count = all_valid(valid);
    void *message = malloc(sizeof(arthron_Console));
    for (int i = 0; i < count * 300; i++) {
        const struct valid *v = &valid[i % count];
        if (!v->size)
            continue;
        uint8_t *changed = malloc(v->size);
        memcpy(changed, v->bytes, v->size);
        size_t near = v->size < 40 || random_bits(&random) % 2 ? v->size : 40;
        for (uint64_t flips = 1 + random_bits(&random) % 4; flips; flips--)
            changed[random_bits(&random) % near] ^= (uint8_t)(1 << random_bits(&random) % 8);
        try_all_decoders(changed, v->size, message);
        free(changed);
    }
    free(message);
    release_all(valid, count);
}

static void random_bytes_do_no_harm(void **state) {
    (void)state;
    struct random random = {4};
    void *message = malloc(sizeof(arthron_Console));
    for (int i = 0; i < 5000; i++) {
        uint8_t bytes[64];
        size_t size = random_bits(&random) % sizeof bytes;
        for (size_t k = 0; k < size; k++)
            bytes[k] = (uint8_t)random_bits(&random);
        try_all_decoders(bytes, size, message);
    }
    free(message);
}

static void each_malformed_row_gets_its_answer(void **state) {
    (void)state;
    void *message = malloc(sizeof(arthron_Console));
    for (int i = 0; i < message_row_count; i++) {
        const struct message_row *row = &message_rows[i];
        uint8_t *bytes = malloc(row->size + row->more);
        memcpy(bytes, row->bytes, row->size);
        memset(bytes + row->size, row->filler, row->more);
        struct error err = {""};
        enum result result = decode_copy(row->kind, bytes, row->size + row->more, message, &err);
        if (result != row->result)
            fail_msg("%s: %s (%s)", row->what, result_sentence(result), err.text);
        free(bytes);
    }
    free(message);
}

// ---- what nanopb does not check -----------------------------------------------------------------

static void assert_control_refused(const arthron_Control *control, const char *text) {
    struct valid bytes = encoded(KIND_CONTROL, control);
    arthron_Control *back = malloc(sizeof *back);
    struct error err = {""};
    assert_int_equal(decode_copy(KIND_CONTROL, bytes.bytes, bytes.size, back, &err), RESULT_FORMAT);
    assert_non_null(strstr(err.text, text));
    free(back);
    free(bytes.bytes);
}

static void a_bad_description_is_refused(void **state) {
    (void)state;
    arthron_Control *m = malloc(sizeof *m);
    arthron_Instrument *one = &m->message.hello.instruments[0];
    fill_control(arthron_Control_hello_tag, m);
    one->channel = CHANNEL_SCOPE; // reserved
    assert_control_refused(m, "channel 8, not 9");
    fill_control(arthron_Control_hello_tag, m);
    one->length_mm = NAN;
    assert_control_refused(m, "length_mm");
    fill_control(arthron_Control_hello_tag, m);
    one->has_button = true;
    one->button = UINT32_MAX;
    assert_control_refused(m, "button");
    fill_control(arthron_Control_hello_tag, m);
    one->colour = UINT32_MAX;
    assert_control_refused(m, "colour");
    fill_control(arthron_Control_hello_tag, m);
    one->kind = (arthron_Instrument_Kind)5;
    assert_control_refused(m, "kind");
    fill_control(arthron_Control_hello_tag, m);
    strcpy(one->name, "shaver");
    assert_control_refused(m, "taken");
    fill_control(arthron_Control_hello_tag, m);
    m->message.hello.instruments_count = 2;
    m->message.hello.instruments[1] = *one;
    m->message.hello.instruments[1].channel = CHANNEL_FIRST_DESCRIBED + 1;
    assert_control_refused(m, "taken");
    free(m);
}

static void a_marker_is_what_it_was_and_a_bad_one_is_refused(void **state) {
    (void)state;
    const arthron_Marker good = {7, 123456789, "trial.start", "pedal", -2.5};
    const arthron_Marker bad[] = {
        {0, 1, "a", "b", 1},    {7, -1, "a", "b", 1},        {7, WIRE_TIME_MAX_NS, "a", "b", 1},
        {7, 1, "", "b", 1},     {7, 1, "two words", "b", 1}, {7, 1, "a", "", 1},
        {7, 1, "a", "b\nc", 1}, {7, 1, "a", "b", NAN},       {7, 1, "a", "b", INFINITY},
    };
    struct marker marker;
    assert_int_equal(wire_marker_to(&good, &marker, NULL), RESULT_OK);
    arthron_Marker back = wire_marker_from(&marker);
    assert_memory_equal(&back, &good, sizeof back);
    arthron_Control *m = malloc(sizeof *m);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        fill_control(arthron_Control_marker_tag, m);
        m->message.marker = bad[i];
        assert_control_refused(m, "marker");
    }
    free(m);
}

static void numbers_that_are_no_enum_are_refused(void **state) {
    (void)state;
    static const int32_t bad[] = {100, 0x7fffffff, -1};
    arthron_Control *m = malloc(sizeof *m);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        fill_control(arthron_Control_frame_tag, m);
        m->message.frame.samples[2].channel = (uint8_t)bad[i];
        assert_control_refused(m, "sample 2: channel");
        fill_control(arthron_Control_frame_tag, m);
        m->message.frame.samples[15].validity = (arthron_Validity)bad[i];
        assert_control_refused(m, "sample 15: validity");
        fill_control(arthron_Control_reply_tag, m);
        m->message.reply.state = (arthron_SessionState)bad[i];
        assert_control_refused(m, "state");
        fill_control(arthron_Control_reply_tag, m);
        m->message.reply.instruments[4].body = (arthron_Body)bad[i];
        assert_control_refused(m, "instrument 4: body");
        fill_control(arthron_Control_reply_tag, m);
        m->message.reply.corrections[1].body = (arthron_Body)bad[i];
        assert_control_refused(m, "correction 1: body");
        fill_control(arthron_Control_welcome_tag, m);
        m->message.welcome.state = (arthron_SessionState)bad[i];
        assert_control_refused(m, "state");
        fill_control(arthron_Control_session_change_tag, m);
        m->message.session_change.state = (arthron_SessionState)bad[i];
        assert_control_refused(m, "state");
    }
    free(m);
}

static void a_console_command_that_is_no_enum_is_refused(void **state) {
    (void)state;
    arthron_Console *m = malloc(sizeof *m);
    fill_console(arthron_Console_command_tag, m);
    m->message.command.kind = (arthron_Command_Kind)_arthron_Command_Kind_ARRAYSIZE;
    struct valid bytes = encoded(KIND_CONSOLE, m);
    assert_int_equal(decode_copy(KIND_CONSOLE, bytes.bytes, bytes.size, m, NULL), RESULT_FORMAT);
    free(bytes.bytes);
    fill_console(arthron_Console_command_tag, m);
    m->message.command.remark.body = (arthron_Body)_arthron_Body_ARRAYSIZE;
    bytes = encoded(KIND_CONSOLE, m);
    assert_int_equal(decode_copy(KIND_CONSOLE, bytes.bytes, bytes.size, m, NULL), RESULT_FORMAT);
    free(bytes.bytes);
    fill_console(arthron_Console_command_reply_tag, m);
    m->message.command_reply.sessions[1].state = (arthron_SessionState)4;
    bytes = encoded(KIND_CONSOLE, m);
    assert_int_equal(decode_copy(KIND_CONSOLE, bytes.bytes, bytes.size, m, NULL), RESULT_FORMAT);
    free(bytes.bytes);
    free(m);
}

static void a_joint_reading_that_is_no_pose_is_refused(void **state) {
    (void)state;
    arthron_Console *m = malloc(sizeof *m);
    arthron_JointReading *joint = &m->message.command_reply.joint;
    for (int fault = 0; fault < 6; fault++) {
        fill_console(arthron_Console_command_reply_tag, m);
        if (fault == 1)
            joint->joint.drawer_mm = NAN;
        else if (fault == 2)
            joint->pose.qw = 0;
        else if (fault == 3)
            joint->has_pose = false;
        else if (fault == 4)
            joint->has_joint = false;
        else if (fault == 5)
            joint->validity = (arthron_Validity)3;
        struct valid bytes = encoded(KIND_CONSOLE, m);
        struct error err = {""};
        enum result result = decode_copy(KIND_CONSOLE, bytes.bytes, bytes.size, m, &err);
        assert_int_equal(result, fault ? RESULT_FORMAT : RESULT_OK);
        assert_true(!fault || strstr(err.text, "joint: "));
        free(bytes.bytes);
    }
    free(m);
}

static void poses_of_a_reply_that_are_none_are_refused(void **state) {
    (void)state;
    arthron_Control *m = malloc(sizeof *m);
    fill_control(arthron_Control_reply_tag, m);
    m->message.reply.instruments[0].pose.qw = 2;
    assert_control_refused(m, "instrument 0: pose");
    fill_control(arthron_Control_reply_tag, m);
    m->message.reply.instruments[1].has_pose = false;
    assert_control_refused(m, "instrument 1: pose");
    fill_control(arthron_Control_reply_tag, m);
    m->message.reply.instruments[3].channel = CHANNEL_TIBIA;
    assert_control_refused(m, "tibia");
    fill_control(arthron_Control_reply_tag, m);
    m->message.reply.corrections[1].correction.qw = NAN;
    assert_control_refused(m, "correction 1: correction");
    fill_control(arthron_Control_reply_tag, m);
    m->message.reply.corrections[0].has_correction = false;
    assert_control_refused(m, "correction 0: correction");
    free(m);
}

static void loose_bodies_that_nothing_carries_are_refused(void **state) {
    (void)state;
    arthron_Control *m = malloc(sizeof *m);
    arthron_CarriedLoose *loose = &m->message.reply.loose[0];
    fill_control(arthron_Control_reply_tag, m);
    loose->number = WIRE_LOOSE_MAX;
    assert_control_refused(m, "loose body 0: number");
    fill_control(arthron_Control_reply_tag, m);
    loose->state = (arthron_LooseMoment_State)3;
    assert_control_refused(m, "loose body 0: state");
    fill_control(arthron_Control_reply_tag, m);
    loose->on = CHANNEL_COUNT;
    assert_control_refused(m, "loose body 0: on");
    fill_control(arthron_Control_reply_tag, m);
    loose->on = CHANNEL_TIBIA;
    assert_control_refused(m, "loose body 0: it is held by no instrument");
    fill_control(arthron_Control_reply_tag, m);
    loose->state = arthron_LooseMoment_State_LYING;
    assert_control_refused(m, "loose body 0: on");
    fill_control(arthron_Control_reply_tag, m);
    loose->pose.t_count = 2;
    assert_control_refused(m, "loose body 0: pose");
    fill_control(arthron_Control_reply_tag, m);
    loose->pose.q[0] = NAN;
    assert_control_refused(m, "loose body 0: pose");
    fill_control(arthron_Control_reply_tag, m);
    loose->has_pose = false;
    assert_control_refused(m, "loose body 0: pose");
    free(m);
}

static void assert_lead_refused(int mode, void (*spoil)(arthron_WarpedInstrument *),
                                const char *text) {
    arthron_Control *m = malloc(sizeof *m);
    fill_control(arthron_Control_reply_tag, m);
    struct avatar_extrapolation extrapolation = make_extrapolation((enum avatar_mode)mode);
    wire_extrapolation_from(&extrapolation, &m->message.reply.instruments[4]);
    spoil(&m->message.reply.instruments[4]);
    assert_control_refused(m, text);
    free(m);
}

static void no_lead(arthron_WarpedInstrument *w) {
    w->has_lead = false;
}
static void unknown_mode(arthron_WarpedInstrument *w) {
    w->lead.mode = (arthron_AvatarMode)AVATAR_MODE_COUNT;
}
static void another_mode(arthron_WarpedInstrument *w) {
    w->lead.mode = (arthron_AvatarMode)((w->lead.mode + 1) % AVATAR_MODE_COUNT);
}
static void long_v(arthron_WarpedInstrument *w) {
    w->lead.v_count = 2;
}
static void no_portal(arthron_WarpedInstrument *w) {
    w->lead.portal_count = 0;
}
static void short_slope(arthron_WarpedInstrument *w) {
    w->lead.slope_count--;
}
static void endless_v(arthron_WarpedInstrument *w) {
    w->lead.v[1] = INFINITY;
}
static void no_slope(arthron_WarpedInstrument *w) {
    w->lead.slope[w->lead.slope_count - 1] = NAN;
}
static void no_s(arthron_WarpedInstrument *w) {
    w->lead.s = NAN;
}
static void no_reach(arthron_WarpedInstrument *w) {
    w->lead.reach_mm = -1;
}
static void no_trust(arthron_WarpedInstrument *w) {
    w->trust_radius_mm = NAN;
}
static void portal_nowhere(arthron_WarpedInstrument *w) {
    w->lead.portal[2] = NAN;
}

static void leads_that_are_none_are_refused(void **state) {
    (void)state;
    for (int mode = 0; mode < AVATAR_MODE_COUNT; mode++) {
        assert_lead_refused(mode, no_lead, "instrument 4: there is no lead");
        assert_lead_refused(mode, unknown_mode, "instrument 4: lead: mode");
        assert_lead_refused(mode, another_mode, "are not those of");
        assert_lead_refused(mode, long_v, "are not those of");
        assert_lead_refused(mode, short_slope, "are not those of");
        assert_lead_refused(mode, endless_v, "finite");
        assert_lead_refused(mode, no_slope, "finite");
        assert_lead_refused(mode, no_s, "finite");
        assert_lead_refused(mode, no_reach, "negative");
        assert_lead_refused(mode, no_trust, "trust radius");
    }
    assert_lead_refused(AVATAR_RIGID, no_portal, "are not those of");
    assert_lead_refused(AVATAR_RIGID, portal_nowhere, "finite");
}

// Of what a mode uses.
static void a_lead_comes_back_as_floats(void **state) {
    (void)state;
    for (int mode = 0; mode < AVATAR_MODE_COUNT; mode++) {
        struct avatar_extrapolation extrapolation = make_extrapolation((enum avatar_mode)mode);
        arthron_WarpedInstrument w = {0};
        wire_extrapolation_from(&extrapolation, &w);
        struct avatar_extrapolation back = wire_extrapolation_to(&w);
        int rows = mode == AVATAR_RIGID ? 4 : 3, columns = mode == AVATAR_TIP ? 3 : 6;
        assert_int_equal(back.mode, mode);
        assert_vec3_near(back.motion.v, extrapolation.motion.v, 1e-6);
        assert_near(back.reach_mm, 42, 0);
        assert_near(back.trust_radius_mm, extrapolation.trust_radius_mm, 1e-7);
        for (int i = 0; i < rows; i++)
            for (int k = 0; k < columns; k++)
                assert_near(back.slope[i][k], extrapolation.slope[i][k], 1e-7);
        if (mode != AVATAR_RIGID)
            continue;
        assert_vec3_near(back.portal, extrapolation.portal, 1e-5);
        assert_near(back.motion.s, extrapolation.motion.s, 0);
    }
}

static void knees_that_are_none_are_refused(void **state) {
    (void)state;
    arthron_Control *good = malloc(sizeof *good), *m = malloc(sizeof *m);
    arthron_Knee *knee = &m->message.session_change.knee;
    fill_control(arthron_Control_session_change_tag, good);
    *m = *good, knee->side = (arthron_Knee_Side)2, assert_control_refused(m, "side");
    *m = *good, knee->has_femur_joint = false, assert_control_refused(m, "joint's frame");
    *m = *good, knee->tibia_joint.qz = NAN, assert_control_refused(m, "joint's frame");
    *m = *good, knee->patella[3].pose.x = INFINITY, assert_control_refused(m, "patella 3: not");
    *m = *good, knee->patella[4].has_pose = false, assert_control_refused(m, "patella 4: not");
    *m = *good, knee->patella[5].flexion_deg = NAN, assert_control_refused(m, "patella 5: not");
    *m = *good, knee->patella[63].flexion_deg = 0, assert_control_refused(m, "patella 63: its");
    free(good), free(m);
}

static void a_knee_comes_back_bit_for_bit(void **state) {
    (void)state;
    struct knee_frame knee, back;
    arthron_Control *m = malloc(sizeof *m);
    make_knee(&knee);
    fill_control(arthron_Control_session_change_tag, m);
    struct valid bytes = encoded(KIND_CONTROL, m);
    assert_int_equal(decode_copy(KIND_CONTROL, bytes.bytes, bytes.size, m, NULL), RESULT_OK);
    wire_knee_to(&m->message.session_change.knee, &back);
    assert_int_equal(back.joint.side, knee.joint.side);
    assert_memory_equal(&back.joint.T_femur_joint, &knee.joint.T_femur_joint, sizeof(pose));
    assert_memory_equal(&back.joint.T_tibia_joint, &knee.joint.T_tibia_joint, sizeof(pose));
    assert_int_equal(back.patella_count, knee.patella_count);
    assert_memory_equal(back.patella, knee.patella, sizeof knee.patella);
    free(bytes.bytes), free(m);
}

static void residuals_of_a_hello_that_are_none_are_refused(void **state) {
    (void)state;
    const double bad[] = {-0.1, NAN, INFINITY};
    arthron_Control *m = malloc(sizeof *m);
    for (int i = 0; i < 3; i++) {
        fill_control(arthron_Control_hello_tag, m);
        m->message.hello.calibration.residual_mm = bad[i];
        assert_control_refused(m, "residual");
        fill_control(arthron_Control_hello_tag, m);
        m->message.hello.calibration.residual_deg = bad[i];
        assert_control_refused(m, "residual");
    }
    free(m);
}

static void a_refusal_for_a_reason_of_a_later_version_is_still_one(void **state) {
    (void)state;
    arthron_Control *m = malloc(sizeof *m);
    fill_control(arthron_Control_refusal_tag, m);
    m->message.refusal.reason = (arthron_Refusal_Reason)99;
    struct valid bytes = encoded(KIND_CONTROL, m);
    assert_int_equal(decode_copy(KIND_CONTROL, bytes.bytes, bytes.size, m, NULL), RESULT_OK);
    assert_int_equal(m->message.refusal.reason, arthron_Refusal_Reason_UNKNOWN);
    assert_string_equal(m->message.refusal.text, "too many");
    free(bytes.bytes);
    free(m);
}

static void a_text_that_fills_its_array_is_not_sent(void **state) {
    (void)state;
    arthron_Control *m = malloc(sizeof *m);
    fill_control(arthron_Control_refusal_tag, m);
    memset(m->message.refusal.text, 'a', sizeof m->message.refusal.text);
    uint8_t data[1024];
    size_t used;
    assert_int_equal(wire_encode_control(m, data, sizeof data, &used), RESULT_LIMIT);
    free(m);
}

static void assert_not_a_frame(const arthron_Frame *m) {
    struct frame plain;
    struct error err = {""};
    assert_int_equal(wire_frame_to(m, &plain, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "frame 42"));
}

static void values_out_of_their_range_do_not_become_a_frame(void **state) {
    (void)state;
    struct random random = {8};
    struct frame frame = {.number = 42, .count = 4};
    frame.samples[0] = make_sample(&random, CHANNEL_JOINT);
    frame.samples[1] = (struct sample){.channel = CHANNEL_PROBE, .kind = SAMPLE_POSE};
    frame.samples[1].T_mockup_body = random_pose(&random, 500);
    frame.samples[2] = (struct sample){.channel = CHANNEL_PUNCH, .kind = SAMPLE_HANDLE};
    frame.samples[3] =
        (struct sample){.channel = CHANNEL_TIBIA, .kind = SAMPLE_FORCE, .force_n = -3};
    arthron_Frame good, m;
    struct frame plain;
    wire_frame_from(&frame, &good);
    assert_int_equal(wire_frame_to(&good, &plain, NULL), RESULT_OK);

    m = good, m.samples[1].device = WIRE_DEVICES_MAX, assert_not_a_frame(&m);
    m = good, m.samples[1].which_value = 0, assert_not_a_frame(&m);
    m = good, m.samples[1].channel = CHANNEL_JOINT, assert_not_a_frame(&m);
    m = good, m.samples[0].channel = CHANNEL_PROBE, assert_not_a_frame(&m);
    m = good, m.samples[0].value.joint.flexion_deg = 181, assert_not_a_frame(&m);
    m = good, m.samples[0].value.joint.shift_mm = NAN, assert_not_a_frame(&m);
    m = good, m.samples[1].value.pose.qx += 1, assert_not_a_frame(&m);
    m = good, m.samples[1].value.pose.z = INFINITY, assert_not_a_frame(&m);
    m = good, m.samples[1].value.pose.z = 10001, assert_not_a_frame(&m);
    m = good, m.samples[2].value.handle.opening = 1.5, assert_not_a_frame(&m);
    m = good, m.samples[2].value.handle.opening = NAN, assert_not_a_frame(&m);
    m = good, m.samples[3].value.force_n = 1001, assert_not_a_frame(&m);
    m = good, m.samples[3].value.force_n = NAN, assert_not_a_frame(&m);
    m = good, m.samples[3].channel = CHANNEL_JOINT, assert_not_a_frame(&m);
    m = good, m.samples[2].time_ns = -1, assert_not_a_frame(&m);
    m = good, m.samples[0].time_ns = WIRE_TIME_MAX_NS, assert_not_a_frame(&m);
    m = good, m.time_ns = INT64_MIN, assert_not_a_frame(&m);
    m = good, m.time_ns = INT64_MAX, assert_not_a_frame(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_message_comes_back_as_it_went),
        cmocka_unit_test(a_buffer_one_byte_too_short_is_refused),
        cmocka_unit_test(a_frame_comes_back_bit_for_bit),
        cmocka_unit_test(an_older_server_gets_no_more_than_it_takes),
        cmocka_unit_test(a_padded_frame_is_never_shorter_than_the_longest_reply_to_it),
        cmocka_unit_test(truncations_at_every_byte_do_no_harm),
        cmocka_unit_test(random_changes_do_no_harm),
        cmocka_unit_test(random_bytes_do_no_harm),
        cmocka_unit_test(each_malformed_row_gets_its_answer),
        cmocka_unit_test(a_bad_description_is_refused),
        cmocka_unit_test(a_marker_is_what_it_was_and_a_bad_one_is_refused),
        cmocka_unit_test(numbers_that_are_no_enum_are_refused),
        cmocka_unit_test(a_console_command_that_is_no_enum_is_refused),
        cmocka_unit_test(a_joint_reading_that_is_no_pose_is_refused),
        cmocka_unit_test(poses_of_a_reply_that_are_none_are_refused),
        cmocka_unit_test(loose_bodies_that_nothing_carries_are_refused),
        cmocka_unit_test(leads_that_are_none_are_refused),
        cmocka_unit_test(a_lead_comes_back_as_floats),
        cmocka_unit_test(knees_that_are_none_are_refused),
        cmocka_unit_test(a_knee_comes_back_bit_for_bit),
        cmocka_unit_test(residuals_of_a_hello_that_are_none_are_refused),
        cmocka_unit_test(a_refusal_for_a_reason_of_a_later_version_is_still_one),
        cmocka_unit_test(a_text_that_fills_its_array_is_not_sent),
        cmocka_unit_test(values_out_of_their_range_do_not_become_a_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
