// From a session's step over the wire to a viewer: what the station shows between two answers is
// what the server's own avatar would do with the newest hand and bones.
#include "runtime/reply.h"

#include "random.h"
#include "test.h"
#include "unit/case_knee.h"
#include "view/predict.h"

#include <stdlib.h>

#define STEPS 400
#define PROBE 0 // of a step's instruments
#define LOOSE 3 // one more than a reply tells

struct rig {
    struct scene *scene;
    struct session *session;
    struct predict *predict;
    struct random random;
    struct session_input input;
    struct session_output output;
    pose T_carrier_loose[LOOSE];
    int warped, turned, corrected, bodies[BODY_COUNT];
};

static const int carriers[LOOSE] = {BODY_TIBIA, BODY_COUNT + PROBE, BODY_FEMUR};

// ---- both sides ---------------------------------------------------------------------------------

// How the runtime tells of the session, and the loop hears it.
static void tell_session(struct rig *h) {
    arthron_Control *message = calloc(1, sizeof *message);
    uint8_t bytes[WIRE_CONTROL_MAX];
    size_t size;
    struct knee_frame knee;
    message->which_message = arthron_Control_session_change_tag;
    reply_session(SESSION_RUNNING, scene_case(h->scene), &message->message.session_change);
    assert_int_equal(wire_encode_control(message, bytes, sizeof bytes, &size), RESULT_OK);
    assert_int_equal(wire_decode_control(bytes, size, message, NULL), RESULT_OK);
    const arthron_SessionChange *change = &message->message.session_change;
    assert_true(change->has_knee);
    wire_knee_to(&change->knee, &knee);
    predict_session(h->predict, change->state, change->case_name, change->case_hash, &knee);
    free(message);
}

static void open_rig(struct rig *h, enum avatar_mode mode) {
    struct knee_case *knee = box_knee();
    struct error err = {""};
    *h = (struct rig){.random = {(uint64_t)mode + 1}};
    if (scene_create(&knee, &h->scene, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    struct session_settings settings = session_settings_default();
    settings.avatar = mode;
    settings.field = field_default(FIELD_INVERSE_DISTANCE);
    h->session = session_create(h->scene, &settings);
    h->predict = predict_create();
    for (int i = 0; i < LOOSE; i++)
        h->T_carrier_loose[i] = random_pose(&h->random, 20);
    tell_session(h);
    h->input = (struct session_input){.kind = INPUT_START, .time_ns = 1};
    session_step(h->session, &h->input, &h->output);
}

static void close_rig(struct rig *h) {
    predict_destroy(&h->predict);
    session_destroy(&h->session);
    scene_destroy(&h->scene);
}

// Three loose bodies that go along, one of them with the probe as shown.
static void carry(struct rig *h) {
    struct session_output *o = &h->output;
    o->loose_count = LOOSE;
    for (int i = 0; i < LOOSE; i++) {
        bool held = carriers[i] >= BODY_COUNT;
        pose T_mockup_carrier =
            held ? o->instruments[PROBE].T_mockup_warped : o->T_mockup_virtual[carriers[i]];
        o->loose[i] = (struct loose_output){held ? LOOSE_HELD : LOOSE_LYING, carriers[i],
                                            pose_compose(T_mockup_carrier, h->T_carrier_loose[i])};
    }
}

static void answer(struct rig *h) {
    const struct frame *frame = &h->input.frame;
    arthron_Reply reply;
    uint8_t bytes[WIRE_DATAGRAM_MAX];
    size_t size;
    session_step(h->session, &h->input, &h->output);
    carry(h);
    reply_from_output(&h->output, scene_case(h->scene), frame->number, frame->time_ns, &reply);
    assert_int_equal(wire_encode_reply(&reply, bytes, sizeof bytes, &size), RESULT_OK);
    assert_int_equal(wire_decode_reply(bytes, size, &reply, NULL), RESULT_OK);
    assert_int_equal(reply.loose_count, WIRE_REPLY_LOOSE);
    assert_true(predict_reply(h->predict, &reply));
}

// ---- frames -------------------------------------------------------------------------------------

static void add(struct frame *frame, struct sample sample) {
    sample.time_ns = frame->time_ns;
    frame->samples[frame->count++] = sample;
}

static struct frame frame_of(uint64_t number, pose T_mockup_femur, struct joint_angles joint,
                             pose T_mockup_tip) {
    struct frame frame = {.number = number, .time_ns = (int64_t)number * 5000000};
    add(&frame, (struct sample){.channel = CHANNEL_FEMUR,
                                .kind = SAMPLE_POSE,
                                .T_mockup_body = T_mockup_femur});
    add(&frame, (struct sample){.kind = SAMPLE_JOINT, .joint = joint});
    add(&frame, (struct sample){
                    .channel = CHANNEL_PROBE, .kind = SAMPLE_POSE, .T_mockup_body = T_mockup_tip});
    return frame;
}

// Through the portal, with the tip between the bones or before the patella.
static pose some_tip(const struct rig *h, struct random *random) {
    vec3 portal = scene_case(h->scene)->portals[0].position;
    vec3 tip = vec3_add((vec3){-15, 15, -17}, random_in_box(random, 20));
    vec3 u = vec3_unit_or(vec3_sub(tip, portal), (vec3){0, 0, 1});
    vec3 axis = vec3_cross((vec3){0, 0, 1}, u);
    double angle = atan2(vec3_length(axis), u.z);
    return (pose){quat_from_axis_angle(vec3_unit_or(axis, (vec3){1, 0, 0}), angle), tip};
}

static arthron_View show(struct rig *h, struct frame *frame) {
    arthron_View view;
    predict_frame(h->predict, frame, false);
    predict_view(h->predict, &view);
    return view;
}

static void assert_shown(const arthron_Pose *shown, pose expected, double tolerance_mm) {
    pose p = wire_pose_to(shown);
    assert_vec3_near(p.translation, expected.translation, tolerance_mm);
    assert_true(quat_angle(p.rotation, expected.rotation) < 1e-6);
}

// ---- what must hold -----------------------------------------------------------------------------

static void assert_bones(const struct rig *h, const arthron_View *view, pose T_moved) {
    for (int i = 0; i < BODY_COUNT; i++) {
        assert_shown(&view->bodies[i].pose, pose_compose(T_moved, h->output.T_mockup_body[i]),
                     1e-9);
        assert_shown(&view->bodies[i].virtual_pose,
                     pose_compose(T_moved, h->output.T_mockup_virtual[i]), 1e-9);
    }
}

// All of them are known once they had their turns.
static void assert_loose(const struct rig *h, const arthron_View *view, pose T_moved) {
    if (h->input.frame.number < LOOSE)
        return;
    assert_int_equal(view->loose_count, LOOSE);
    for (int i = 0; i < LOOSE; i++) {
        const arthron_ViewLoose *loose = &view->loose[i];
        assert_int_equal(loose->number, i);
        assert_int_equal(loose->state, h->output.loose[i].state);
        assert_int_equal(loose->on, carriers[i] < BODY_COUNT ? carriers[i] : CHANNEL_PROBE);
        assert_true(loose->has_pose);
        assert_shown(&loose->pose, pose_compose(T_moved, h->output.loose[i].T_mockup_loose), 5e-5);
    }
}

// The hand goes on while the bones stay: the server's own way of going on.
static void hand_moves(struct rig *h, pose T_mockup_tip) {
    const struct instrument_output *o = &h->output.instruments[PROBE];
    struct frame now = h->input.frame;
    pose tip = T_mockup_tip;
    vec3 axis = random_direction(&h->random);
    quat turn = quat_from_axis_angle(axis, random_between(&h->random, 0, 0.02));
    tip.rotation = quat_multiply(turn, tip.rotation);
    tip.translation = vec3_add(tip.translation, random_in_box(&h->random, 1));
    now.number++;
    now.samples[2].T_mockup_body = tip;
    struct avatar_motion motion = avatar_extrapolate(&o->extrapolation, T_mockup_tip, tip);
    arthron_View view = show(h, &now);
    assert_shown(&view.instruments[0].warped,
                 avatar_place(o->extrapolation.mode, o->extrapolation.portal, &motion, tip), 2e-5);
    assert_int_equal(view.instruments[0].clamped,
                     avatar_share(&o->extrapolation, T_mockup_tip, tip) < 1);
}

// Hand and bones are moved as one: all that is shown is moved just so.
static void knee_moves(struct rig *h, pose T_mockup_tip) {
    const struct instrument_output *o = &h->output.instruments[PROBE];
    pose T_moved = random_pose(&h->random, 50);
    struct frame now = h->input.frame;
    now.number++;
    now.samples[0].T_mockup_body = pose_compose(T_moved, now.samples[0].T_mockup_body);
    now.samples[2].T_mockup_body = pose_compose(T_moved, T_mockup_tip);
    arthron_View view = show(h, &now);
    assert_bones(h, &view, T_moved);
    assert_loose(h, &view, T_moved);
    assert_shown(&view.instruments[0].warped, pose_compose(T_moved, o->T_mockup_warped), 1e-5);
}

static void count(struct rig *h) {
    const struct instrument_output *o = &h->output.instruments[PROBE];
    h->warped += vec3_distance(o->T_mockup_warped.translation, o->T_mockup_tip.translation) > 0.1;
    h->turned += quat_angle(o->T_mockup_warped.rotation, o->T_mockup_tip.rotation) > 1e-3;
    int group = o->warp.nearest;
    h->bodies[group < 0 ? BODY_FEMUR : scene_case(h->scene)->groups[group].body]++;
    h->corrected += vec3_distance(h->output.T_mockup_virtual[BODY_TIBIA].translation,
                                  h->output.T_mockup_body[BODY_TIBIA].translation) > 0.01;
}

static void step(struct rig *h, uint64_t number) {
    struct joint_angles joint = {.flexion_deg = random_between(&h->random, 0, 60),
                                 .varus_deg = random_between(&h->random, -6, 2),
                                 .drawer_mm = random_between(&h->random, -2, 6)};
    pose T_mockup_femur = {quat_from_axis_angle((vec3){0, 0, 1}, 0.1), {3, 4, 5}};
    pose T_mockup_tip = pose_compose(T_mockup_femur, some_tip(h, &h->random));
    h->input = (struct session_input){.kind = INPUT_FRAME, .time_ns = (int64_t)number * 5000000};
    h->input.frame = frame_of(number, T_mockup_femur, joint, T_mockup_tip);
    predict_frame(h->predict, &h->input.frame, true);
    answer(h);
    const struct instrument_output *o = &h->output.instruments[PROBE];
    arthron_View view;
    predict_view(h->predict, &view);
    assert_int_equal(view.instruments_count, 1);
    assert_int_equal(view.instruments[0].warp_validity, arthron_Validity_OK);
    assert_shown(&view.instruments[0].tip, T_mockup_tip, 0);
    assert_shown(&view.instruments[0].warped, o->T_mockup_warped, 1e-5);
    assert_bones(h, &view, pose_identity());
    assert_loose(h, &view, pose_identity());
    hand_moves(h, T_mockup_tip);
    knee_moves(h, T_mockup_tip);
    count(h);
}

static void a_viewer_sees_what_the_server_would_show(void **state) {
    (void)state;
    for (int mode = 0; mode < AVATAR_MODE_COUNT; mode++) {
        struct rig h;
        open_rig(&h, (enum avatar_mode)mode);
        for (uint64_t number = 1; number <= STEPS; number++)
            step(&h, number);
        // Or the test says nothing.
        assert_true(h.warped > STEPS / 10 && h.corrected > STEPS / 10);
        assert_true(h.bodies[BODY_FEMUR] > 10 && h.bodies[BODY_TIBIA] > 10 &&
                    h.bodies[BODY_PATELLA] > 10);
        assert_int_equal(h.turned > STEPS / 20, mode == AVATAR_RIGID);
        close_rig(&h);
    }
}

static void fill_instrument(struct random *random, struct instrument_output *o) {
    *o = (struct instrument_output){.present = true,
                                    .validity = VALIDITY_HELD,
                                    .T_mockup_tip = random_pose(random, 100),
                                    .T_mockup_warped = random_pose(random, 100),
                                    .warp.nearest_mm = 1};
    o->extrapolation = (struct avatar_extrapolation){.mode = AVATAR_RIGID,
                                                     .portal = random_in_box(random, 100),
                                                     .motion = {random_in_box(random, 1), 1},
                                                     .reach_mm = 100,
                                                     .trust_radius_mm = 1};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 6; k++)
            o->extrapolation.slope[i][k] = random_between(random, 0.1, 1);
}

static int group_on_patella(const struct knee_case *knee) {
    int group = 0;
    while (knee->groups[group].body != BODY_PATELLA)
        group++;
    return group;
}

// A station's padded frame makes room for it.
static void the_longest_reply_fits_a_datagram_and_the_frame_that_it_answers(void **state) {
    (void)state;
    struct rig h;
    open_rig(&h, AVATAR_RIGID);
    struct frame frame = {.number = UINT64_MAX, .time_ns = WIRE_TIME_MAX_NS - 1};
    struct session_output *output = &h.output;
    output->state = SESSION_CLOSED;
    output->events = UINT32_MAX;
    for (int i = BODY_TIBIA; i < BODY_COUNT; i++)
        output->T_mockup_virtual[i] = random_pose(&h.random, 100);
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        fill_instrument(&h.random, &output->instruments[i]);
        output->instruments[i].warp.nearest = group_on_patella(scene_case(h.scene));
        add(&frame, (struct sample){.channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + i),
                                    .kind = SAMPLE_HANDLE});
    }
    arthron_Reply reply;
    arthron_Frame message;
    uint8_t bytes[WIRE_DATAGRAM_MAX];
    size_t reply_size, frame_size;
    reply_from_output(output, scene_case(h.scene), frame.number, frame.time_ns, &reply);
    assert_int_equal(reply.corrections_count, 2);
    wire_frame_from(&frame, &message);
    wire_frame_pad(&message);
    assert_int_equal(wire_encode_reply(&reply, bytes, sizeof bytes, &reply_size), RESULT_OK);
    assert_int_equal(wire_encode_frame(&message, bytes, sizeof bytes, &frame_size), RESULT_OK);
    assert_int_equal(reply_size, 163 + 5 * 225); // as PROTOCOL.md says
    assert_true(reply_size <= frame_size);
    close_rig(&h);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_viewer_sees_what_the_server_would_show),
        cmocka_unit_test(the_longest_reply_fits_a_datagram_and_the_frame_that_it_answers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
