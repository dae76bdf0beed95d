// What a viewer is shown between two answers of the server: against servers whose motion is linear
// in the hand's way, where to follow is to know, and against the rules for what is late or lost.
#include "view/predict.h"

#include "base/clock.h"
#include "random.h"
#include "test.h"

#include <string.h>

#define FLOAT_MM 2e-5 // what floats on the wire leave of values up to 100

static struct predict *predict;
static struct knee_frame knee;

static int begin(void **state) {
    (void)state;
    struct random random = {7};
    knee = (struct knee_frame){
        .joint = {SIDE_LEFT, random_pose(&random, 20), random_pose(&random, 20)},
        .patella_count = 2,
        .patella = {{0, random_pose(&random, 20)}, {90, random_pose(&random, 20)}}};
    predict = predict_create();
    predict_session(predict, arthron_SessionState_RUNNING, "knee", 42, &knee);
    return 0;
}

static int end(void **state) {
    (void)state;
    predict_destroy(&predict);
    return 0;
}

// ---- frames -------------------------------------------------------------------------------------

// The hand and the bones at one time.
struct moment {
    pose T_mockup_femur, T_mockup_tip;
    struct joint_angles joint;
};

static struct moment some_moment(struct random *random) {
    return (struct moment){random_pose(random, 30),
                           random_pose(random, 80),
                           {random_between(random, 0, 120), 3, -4, 1, 2, 0.5}};
}

// A little later.
static struct moment moved(const struct moment *from, struct random *random, double most_mm) {
    struct moment to = *from;
    quat turn = quat_from_axis_angle(random_direction(random), random_between(random, 0, 0.1));
    to.T_mockup_tip.rotation = quat_multiply(turn, from->T_mockup_tip.rotation);
    to.T_mockup_tip.translation =
        vec3_add(from->T_mockup_tip.translation, random_in_box(random, most_mm));
    to.T_mockup_femur.translation.x += random_between(random, -1, 1);
    to.joint.flexion_deg += random_between(random, -2, 2);
    return to;
}

static void add(struct frame *frame, struct sample sample) {
    frame->samples[frame->count++] = sample;
}

static struct sample pose_sample(enum channel channel, pose p, int64_t time_ns) {
    return (struct sample){
        .channel = channel, .kind = SAMPLE_POSE, .time_ns = time_ns, .T_mockup_body = p};
}

static struct frame frame_of(const struct moment *m, uint64_t number, int64_t time_ns) {
    struct frame frame = {.number = number, .time_ns = time_ns};
    add(&frame, pose_sample(CHANNEL_FEMUR, m->T_mockup_femur, time_ns - 1));
    add(&frame, pose_sample(CHANNEL_PROBE, m->T_mockup_tip, time_ns - 1));
    add(&frame, (struct sample){.kind = SAMPLE_JOINT, .joint = m->joint});
    add(&frame,
        (struct sample){.channel = CHANNEL_PROBE, .kind = SAMPLE_HANDLE, .handle = {0.25, 5}});
    add(&frame, (struct sample){.channel = CHANNEL_PROBE, .kind = SAMPLE_FORCE, .force_n = -1.5});
    return frame;
}

static void pass(const struct moment *m, uint64_t number, int64_t time_ns, bool sent) {
    struct frame frame = frame_of(m, number, time_ns);
    predict_frame(predict, &frame, sent);
}

static pose tibia_of(const struct moment *m) {
    return pose_compose(m->T_mockup_femur, joint_to_pose(&knee.joint, &m->joint));
}

static pose tip_in_tibia(const struct moment *m) {
    return pose_compose(pose_inverse(tibia_of(m)), m->T_mockup_tip);
}

// ---- answers ------------------------------------------------------------------------------------

static struct avatar_extrapolation some_extrapolation(struct random *random,
                                                      enum avatar_mode mode) {
    double size = mode == AVATAR_RIGID ? 0.05 : 3;
    struct avatar_extrapolation extrapolation = {.mode = mode,
                                                 .portal = random_in_box(random, 100),
                                                 .motion = {random_in_box(random, size), 0},
                                                 .trust_radius_mm = 1e6,
                                                 .reach_mm = mode == AVATAR_TIP ? 0 : 120};
    if (mode == AVATAR_RIGID)
        extrapolation.motion.s = random_between(random, -2, 2);
    for (int i = 0; i < (mode == AVATAR_RIGID ? 4 : 3); i++)
        for (int k = 0; k < (mode == AVATAR_TIP ? 3 : 6); k++)
            extrapolation.slope[i][k] =
                random_between(random, -0.3, 0.3) * (mode == AVATAR_RIGID ? 0.05 : 1);
    return extrapolation;
}

static arthron_Reply reply_to(uint64_t number, const struct moment *m,
                              const struct avatar_extrapolation *extrapolation) {
    arthron_Reply reply = {
        .frame_number = number, .state = arthron_SessionState_RUNNING, .instruments_count = 1};
    arthron_WarpedInstrument *w = &reply.instruments[0];
    *w = (arthron_WarpedInstrument){
        .channel = CHANNEL_PROBE, .body = arthron_Body_BODY_TIBIA, .has_pose = true};
    pose tip = tip_in_tibia(m);
    w->pose = wire_pose_from(
        avatar_place(extrapolation->mode, extrapolation->portal, &extrapolation->motion, tip));
    wire_extrapolation_from(extrapolation, w);
    return reply;
}

// v and s where the server's motion is linear in the way from `sent`: its rule, written once more.
static struct avatar_motion linear_motion(const struct avatar_extrapolation *extrapolation,
                                          pose sent, pose now) {
    pose turn = {quat_multiply(now.rotation, quat_conjugate(sent.rotation)), {0}};
    vec3 w = pose_log(turn).rotation, d = vec3_sub(now.translation, sent.translation);
    const double way[6] = {d.x, d.y, d.z, w.x, w.y, w.z};
    double to[4] = {extrapolation->motion.v.x, extrapolation->motion.v.y, extrapolation->motion.v.z,
                    extrapolation->motion.s};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 6; k++)
            to[i] += extrapolation->slope[i][k] * way[k];
    return (struct avatar_motion){{to[0], to[1], to[2]}, to[3]};
}

static arthron_View view_now(void) {
    arthron_View view;
    predict_view(predict, &view);
    return view;
}

static void assert_pose_near(const arthron_Pose *shown, pose expected, double tolerance_mm) {
    pose p = wire_pose_to(shown);
    assert_vec3_near(p.translation, expected.translation, tolerance_mm);
    assert_true(quat_angle(p.rotation, expected.rotation) < 1e-6);
}

// ---- following ----------------------------------------------------------------------------------

static void a_motion_that_is_linear_is_met_while_hand_and_bones_move(void **state) {
    (void)state;
    struct random random = {1};
    uint64_t number = 0;
    for (int i = 0; i < 300; i++) {
        enum avatar_mode mode = (enum avatar_mode)(i % AVATAR_MODE_COUNT);
        struct moment sent = some_moment(&random), now = moved(&sent, &random, 4);
        struct avatar_extrapolation extrapolation = some_extrapolation(&random, mode);
        arthron_Reply reply = reply_to(++number, &sent, &extrapolation);
        pass(&sent, number, 1000, true);
        pass(&now, ++number, 2000, true);
        assert_true(predict_reply(predict, &reply));
        pose T_tibia_now = tip_in_tibia(&now);
        struct avatar_motion motion =
            linear_motion(&extrapolation, tip_in_tibia(&sent), T_tibia_now);
        pose T_tibia_warped = avatar_place(mode, extrapolation.portal, &motion, T_tibia_now);
        arthron_View view = view_now();
        assert_int_equal(view.instruments_count, 1);
        assert_int_equal(view.instruments[0].warp_validity, arthron_Validity_OK);
        assert_false(view.instruments[0].clamped);
        assert_pose_near(&view.instruments[0].warped, pose_compose(tibia_of(&now), T_tibia_warped),
                         FLOAT_MM);
    }
}

static void where_nothing_moved_the_avatar_is_where_the_server_put_it(void **state) {
    (void)state;
    struct random random = {2};
    for (uint64_t number = 1; number < 200; number++) {
        struct moment m = some_moment(&random);
        struct avatar_extrapolation extrapolation =
            some_extrapolation(&random, (enum avatar_mode)(number % 3));
        arthron_Reply reply = reply_to(number, &m, &extrapolation);
        pass(&m, number, 1000, true);
        assert_true(predict_reply(predict, &reply));
        pose T_tibia_warped = wire_pose_to(&reply.instruments[0].pose);
        arthron_View view = view_now();
        assert_pose_near(&view.instruments[0].warped, pose_compose(tibia_of(&m), T_tibia_warped),
                         1e-5);
        vec3 tip = tip_in_tibia(&m).translation;
        assert_near(predict_warp_mm(predict), vec3_distance(T_tibia_warped.translation, tip), 1e-9);
    }
}

static void poses_in_the_frame_of_a_bone_stay_on_it(void **state) {
    (void)state;
    struct random random = {3};
    struct moment sent = some_moment(&random), now = moved(&sent, &random, 1);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_RIGID);
    now.T_mockup_tip = pose_compose(tibia_of(&now), tip_in_tibia(&sent));
    arthron_Reply reply = reply_to(1, &sent, &extrapolation);
    pass(&sent, 1, 1000, true);
    pass(&now, 2, 2000, true);
    predict_reply(predict, &reply);
    arthron_View view = view_now();
    pose T_tibia_warped = wire_pose_to(&reply.instruments[0].pose);
    assert_pose_near(&view.instruments[0].warped, pose_compose(tibia_of(&now), T_tibia_warped),
                     1e-5);
}

static void past_the_trust_radius_the_way_is_cut(void **state) {
    (void)state;
    struct random random = {4};
    struct moment sent = some_moment(&random), now = sent;
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    extrapolation.trust_radius_mm = 0.5;
    now.T_mockup_tip.translation.z += 2;
    arthron_Reply reply = reply_to(1, &sent, &extrapolation);
    pass(&sent, 1, 1000, true);
    pass(&now, 2, 2000, true);
    predict_reply(predict, &reply);
    struct moment quarter = sent;
    quarter.T_mockup_tip.translation.z += 0.5;
    pose at_quarter = tip_in_tibia(&quarter), at_end = tip_in_tibia(&now);
    struct avatar_motion motion = linear_motion(&extrapolation, tip_in_tibia(&sent), at_quarter);
    pose T_tibia_warped = avatar_place(AVATAR_TIP, extrapolation.portal, &motion, at_end);
    arthron_View view = view_now();
    assert_true(view.instruments[0].clamped);
    assert_pose_near(&view.instruments[0].warped, pose_compose(tibia_of(&now), T_tibia_warped),
                     FLOAT_MM);
}

// ---- what is late, lost or of something else ----------------------------------------------------

static void an_answer_grows_old_then_is_lost(void **state) {
    (void)state;
    struct random random = {5};
    struct moment m = some_moment(&random);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    arthron_Reply reply = reply_to(1, &m, &extrapolation);
    pass(&m, 1, 0, true);
    predict_reply(predict, &reply);
    static const struct {
        int64_t age_ms;
        arthron_Validity validity;
    } ages[] = {{0, arthron_Validity_OK},
                {100, arthron_Validity_OK},
                {101, arthron_Validity_HELD},
                {1000, arthron_Validity_HELD},
                {1001, arthron_Validity_LOST}};
    for (size_t i = 0; i < sizeof ages / sizeof *ages; i++) {
        pass(&m, 2 + i, ages[i].age_ms * NS_PER_MS, false);
        arthron_View view = view_now();
        assert_int_equal(view.instruments[0].validity, arthron_Validity_OK);
        assert_int_equal(view.instruments[0].warp_validity, ages[i].validity);
        bool lost = ages[i].validity == arthron_Validity_LOST;
        assert_int_equal(view.instruments[0].has_warped, !lost);
        assert_near(view.instruments[0].age_ms, lost ? 0 : (double)ages[i].age_ms, 1e-3);
    }
    pass(&m, 9, 2000 * NS_PER_MS, true);
    reply.frame_number = 9;
    predict_reply(predict, &reply);
    assert_int_equal(view_now().instruments[0].warp_validity, arthron_Validity_OK);
}

// Each answer comes 400 ms after its frame: it is held from 100 ms after the next one was due.
static void a_long_way_makes_no_answer_old(void **state) {
    (void)state;
    struct random random = {8};
    struct moment m = some_moment(&random);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    uint64_t number = 1;
    for (; number <= 100; number++) {
        arthron_Reply reply = reply_to(number < 40 ? 0 : number - 40, &m, &extrapolation);
        pass(&m, number, (int64_t)number * 10 * NS_PER_MS, true);
        if (predict_reply(predict, &reply))
            assert_int_equal(view_now().instruments[0].warp_validity, arthron_Validity_OK);
    }
    for (int more = 0; more < 120; more++, number++) {
        pass(&m, number, (int64_t)number * 10 * NS_PER_MS, true);
        assert_int_equal(view_now().instruments[0].warp_validity, more < 10 ? arthron_Validity_OK
                                                                  : more < 100
                                                                      ? arthron_Validity_HELD
                                                                      : arthron_Validity_LOST);
    }
}

static void answers_to_forgotten_unsent_or_older_frames_are_dropped(void **state) {
    (void)state;
    struct random random = {6};
    struct moment m = some_moment(&random);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    arthron_Reply reply = reply_to(3, &m, &extrapolation);
    assert_false(predict_reply(predict, &reply));
    pass(&m, 3, 1000, false);
    assert_false(predict_reply(predict, &reply));
    assert_int_equal(view_now().instruments[0].warp_validity, arthron_Validity_LOST);
    for (uint64_t number = 3; number <= 3 + PREDICT_REMEMBERED; number++)
        pass(&m, number, 1000, true);
    assert_false(predict_reply(predict, &reply)); // just forgotten
    reply.frame_number = 5;
    assert_true(predict_reply(predict, &reply));
    reply.frame_number = 4;
    assert_false(predict_reply(predict, &reply));
    reply.frame_number = 0;
    assert_false(predict_reply(predict, &reply));
}

static void events_are_counted_even_of_dropped_answers(void **state) {
    (void)state;
    struct random random = {7};
    struct moment m = some_moment(&random);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    arthron_Reply reply = reply_to(1, &m, &extrapolation);
    pass(&m, 1, 1000, true);
    reply.events = 1u << 3 | 1u << 31;
    assert_true(predict_reply(predict, &reply));
    reply.frame_number = 77;
    reply.events = 1u << 3;
    assert_false(predict_reply(predict, &reply));
    arthron_View view = view_now();
    assert_int_equal(view.events_count, 32);
    for (int bit = 0; bit < 32; bit++)
        assert_int_equal(view.events[bit], bit == 3 ? 2 : bit == 31);
}

static void tell(uint64_t number, uint32_t events, uint32_t cuts, uint32_t pieces) {
    arthron_Reply reply = {.frame_number = number,
                           .events = events,
                           .event_counts_count = 7,
                           .event_counts = {[5] = cuts, [6] = pieces}};
    predict_reply(predict, &reply);
}

static void assert_events(uint32_t cuts, uint32_t pieces) {
    arthron_View view = view_now();
    assert_int_equal(view.events[5], cuts);
    assert_int_equal(view.events[6], pieces);
}

static void a_lost_reply_loses_no_event(void **state) {
    (void)state;
    tell(1, 1u << 5, 1, 0);
    tell(4, 0, 3, 1); // replies 2 and 3 are lost, with two cuts and a piece
    assert_events(3, 1);
    tell(3, 1u << 5 | 1u << 6, 3, 1); // late
    tell(2, 1u << 5, 2, 0);
    assert_events(3, 1);
}

static void counts_begin_anew_with_a_connection(void **state) {
    (void)state;
    predict_connection(predict, 1);
    tell(1, 1u << 5, 5, 2);
    predict_connection(predict, 1);
    tell(2, 0, 5, 2);
    assert_events(5, 2);
    predict_connection(predict, 2);
    tell(3, 1u << 5, 6, 1);
    assert_events(11, 3);
}

static void a_reply_that_had_no_room_for_counts_has_its_bits(void **state) {
    (void)state;
    tell(1, 1u << 5, 1, 0);
    arthron_Reply reply = {.frame_number = 2, .events = 1u << 5};
    predict_reply(predict, &reply);
    assert_events(2, 0);
    tell(3, 0, 4, 0); // two cuts came between
    assert_events(4, 0);
}

static void another_case_makes_all_answers_void(void **state) {
    (void)state;
    struct random random = {8};
    struct moment m = some_moment(&random);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    arthron_Reply reply = reply_to(1, &m, &extrapolation);
    pass(&m, 1, 1000, true);
    predict_reply(predict, &reply);
    predict_session(predict, arthron_SessionState_PAUSED, "knee", 42, &knee);
    assert_int_equal(view_now().instruments[0].warp_validity, arthron_Validity_OK);
    assert_int_equal(view_now().state, arthron_SessionState_PAUSED);
    pass(&m, 2, 1000, true);
    predict_session(predict, arthron_SessionState_RUNNING, "other", 43, &knee);
    arthron_View view = view_now();
    assert_int_equal(view.instruments[0].warp_validity, arthron_Validity_LOST);
    assert_string_equal(view.case_name, "other");
    assert_int_equal(view.case_hash, 43);
    reply.frame_number = 2;
    assert_false(predict_reply(predict, &reply));
}

static void an_instrument_that_an_answer_leaves_out_has_none(void **state) {
    (void)state;
    struct random random = {9};
    struct moment m = some_moment(&random);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    arthron_Reply reply = reply_to(1, &m, &extrapolation), other = reply_to(2, &m, &extrapolation);
    other.instruments[0].channel = CHANNEL_KNIFE; // which no frame had
    pass(&m, 1, 1000, true);
    pass(&m, 2, 1000, true);
    predict_reply(predict, &reply);
    predict_reply(predict, &other);
    arthron_View view = view_now();
    assert_int_equal(view.instruments_count, 1);
    assert_int_equal(view.instruments[0].warp_validity, arthron_Validity_LOST);
    assert_false(view.instruments[0].has_warped);
}

static void a_lost_instrument_has_neither_pose(void **state) {
    (void)state;
    struct random random = {10};
    struct moment m = some_moment(&random);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    arthron_Reply reply = reply_to(1, &m, &extrapolation);
    pass(&m, 1, 1000, true);
    predict_reply(predict, &reply);
    struct frame frame = frame_of(&m, 2, 2000);
    frame.samples[1].validity = VALIDITY_LOST;
    predict_frame(predict, &frame, true);
    const arthron_ViewInstrument shown = view_now().instruments[0];
    assert_int_equal(shown.validity, arthron_Validity_LOST);
    assert_int_equal(shown.warp_validity, arthron_Validity_LOST);
    assert_false(shown.has_tip || shown.has_warped);
    assert_true(shown.has_handle);
    assert_int_equal(shown.handle.buttons, 5);
    assert_true(shown.has_force_n && shown.force_n == -1.5);
    frame.samples[3].validity = VALIDITY_LOST;
    predict_frame(predict, &frame, true);
    assert_false(view_now().instruments[0].has_handle);
}

// ---- bones --------------------------------------------------------------------------------------

static void show_frame(struct frame *frame, arthron_View *out_view) {
    predict_frame(predict, frame, false);
    *out_view = view_now();
    frame->count = 0;
}

static void bones_hang_on_the_femur_by_the_joint(void **state) {
    (void)state;
    struct random random = {11};
    struct moment m = some_moment(&random);
    m.joint.flexion_deg = 45;
    pass(&m, 1, 1000, false);
    arthron_View view = view_now();
    pose half =
        pose_interpolate(knee.patella[0].T_femur_patella, knee.patella[1].T_femur_patella, 0.5);
    assert_pose_near(&view.bodies[0].pose, m.T_mockup_femur, 1e-9);
    assert_pose_near(&view.bodies[1].pose, tibia_of(&m), 1e-9);
    assert_pose_near(&view.bodies[2].pose, pose_compose(m.T_mockup_femur, half), 1e-9);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(view.bodies[i].body, i);
        assert_int_equal(view.bodies[i].validity, arthron_Validity_OK);
        assert_memory_equal(&view.bodies[i].pose, &view.bodies[i].virtual_pose,
                            sizeof(arthron_Pose));
    }
}

static void tracked_bones_are_where_they_are_seen_and_stay_there(void **state) {
    (void)state;
    struct random random = {12};
    pose T_mockup_tibia = random_pose(&random, 50), T_mockup_patella = random_pose(&random, 50);
    struct joint_angles joint = {30};
    struct frame frame = {.time_ns = 1};
    arthron_View view;
    add(&frame, pose_sample(CHANNEL_TIBIA, T_mockup_tibia, 1));
    add(&frame, pose_sample(CHANNEL_PATELLA, T_mockup_patella, 1));
    show_frame(&frame, &view);
    assert_pose_near(&view.bodies[0].pose, pose_identity(), 0);
    assert_pose_near(&view.bodies[1].pose, T_mockup_tibia, 0);
    assert_pose_near(&view.bodies[2].pose, T_mockup_patella, 0);
    struct sample lost = pose_sample(CHANNEL_TIBIA, random_pose(&random, 50), 2);
    lost.validity = VALIDITY_LOST;
    add(&frame, lost);
    show_frame(&frame, &view);
    assert_int_equal(view.bodies[1].validity, arthron_Validity_LOST);
    assert_pose_near(&view.bodies[1].pose, T_mockup_tibia, 0);
    add(&frame, (struct sample){.kind = SAMPLE_JOINT, .joint = joint});
    show_frame(&frame, &view); // the encoders stand in
    assert_int_equal(view.bodies[1].validity, arthron_Validity_OK);
    assert_pose_near(&view.bodies[1].pose, joint_to_pose(&knee.joint, &joint), 1e-9);
}

static void the_patella_follows_a_tracked_tibia_too(void **state) {
    (void)state;
    struct random random = {15};
    struct frame frame = {.time_ns = 1};
    arthron_View view;
    pose T_mockup_femur = random_pose(&random, 50);
    pose T_femur_tibia = joint_to_pose(&knee.joint, &(struct joint_angles){.flexion_deg = 45});
    add(&frame, pose_sample(CHANNEL_FEMUR, T_mockup_femur, 1));
    add(&frame, pose_sample(CHANNEL_TIBIA, pose_compose(T_mockup_femur, T_femur_tibia), 1));
    show_frame(&frame, &view);
    pose half =
        pose_interpolate(knee.patella[0].T_femur_patella, knee.patella[1].T_femur_patella, 0.5);
    assert_pose_near(&view.bodies[2].pose, pose_compose(T_mockup_femur, half), 1e-9);
}

static void without_a_knee_what_is_not_tracked_is_lost(void **state) {
    (void)state;
    struct random random = {13};
    struct moment m = some_moment(&random);
    predict_session(predict, arthron_SessionState_CLOSED, "", 0, NULL);
    pass(&m, 1, 1000, false);
    arthron_View view = view_now();
    assert_int_equal(view.bodies[0].validity, arthron_Validity_OK);
    assert_int_equal(view.bodies[1].validity, arthron_Validity_LOST);
    assert_int_equal(view.bodies[2].validity, arthron_Validity_LOST);
}

static void a_corrected_bone_is_shown_where_its_ligaments_let_it(void **state) {
    (void)state;
    struct random random = {14};
    struct moment sent = some_moment(&random), now = moved(&sent, &random, 1);
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    pose T_body_virtual = random_pose(&random, 10);
    arthron_Reply reply = reply_to(1, &sent, &extrapolation);
    reply.corrections_count = 1;
    reply.corrections[0] =
        (arthron_Correction){arthron_Body_BODY_TIBIA, true, wire_pose_from(T_body_virtual)};
    pass(&sent, 1, 1000, true);
    pass(&now, 2, 1000, true);
    predict_reply(predict, &reply);
    arthron_View view = view_now();
    assert_pose_near(&view.bodies[1].pose, tibia_of(&now), 1e-9);
    assert_pose_near(&view.bodies[1].virtual_pose, pose_compose(tibia_of(&now), T_body_virtual),
                     1e-9);
    assert_pose_near(&view.bodies[2].virtual_pose, wire_pose_to(&view.bodies[2].pose), 0);
    reply = reply_to(2, &now, &extrapolation);
    predict_reply(predict, &reply);
    view = view_now();
    assert_pose_near(&view.bodies[1].virtual_pose, tibia_of(&now), 1e-9);
}

static arthron_Reply reply_about_loose(uint64_t number, const struct moment *m,
                                       arthron_LooseMoment_State state) {
    struct random random = {16};
    struct avatar_extrapolation extrapolation = some_extrapolation(&random, AVATAR_TIP);
    arthron_Reply reply = reply_to(number, m, &extrapolation);
    reply.loose_count = 1;
    reply.loose[0] =
        (arthron_CarriedLoose){.number = 4, .state = state, .on = CHANNEL_PROBE, .has_pose = true};
    reply.loose[0].pose = wire_short_pose_from(random_pose(&random, 10));
    return reply;
}

static void a_held_loose_body_goes_along_and_has_no_place_without_its_holder(void **state) {
    (void)state;
    struct random random = {15};
    struct moment m = some_moment(&random);
    pass(&m, 1, 1000, true);
    arthron_Reply reply = reply_about_loose(1, &m, arthron_LooseMoment_State_HELD);
    predict_reply(predict, &reply);
    arthron_View view = view_now();
    assert_int_equal(view.loose_count, 1);
    assert_int_equal(view.loose[0].number, 4);
    assert_int_equal(view.loose[0].on, CHANNEL_PROBE);
    assert_true(view.loose[0].has_pose);
    pose T_warped_loose = wire_short_pose_to(&reply.loose[0].pose);
    assert_pose_near(&view.loose[0].pose,
                     pose_compose(wire_pose_to(&view.instruments[0].warped), T_warped_loose), 1e-5);
    pass(&m, 2, 1000 + PREDICT_LOST_NS + 1, false); // no answer any more
    view = view_now();
    assert_int_equal(view.loose_count, 1);
    assert_false(view.loose[0].has_pose);
}

static void a_loose_body_that_is_out_has_no_place_and_another_case_has_none(void **state) {
    (void)state;
    struct random random = {17};
    struct moment m = some_moment(&random);
    pass(&m, 1, 1000, true);
    arthron_Reply reply = reply_about_loose(1, &m, arthron_LooseMoment_State_OUT);
    predict_reply(predict, &reply);
    arthron_View view = view_now();
    assert_int_equal(view.loose[0].state, arthron_LooseMoment_State_OUT);
    assert_false(view.loose[0].has_pose);
    predict_session(predict, arthron_SessionState_RUNNING, "other", 99, &knee);
    view = view_now();
    assert_int_equal(view.loose_count, 0);
}

int main(void) {
#define WITH_A_KNEE(test) cmocka_unit_test_setup_teardown(test, begin, end)
    const struct CMUnitTest tests[] = {
        WITH_A_KNEE(a_motion_that_is_linear_is_met_while_hand_and_bones_move),
        WITH_A_KNEE(where_nothing_moved_the_avatar_is_where_the_server_put_it),
        WITH_A_KNEE(poses_in_the_frame_of_a_bone_stay_on_it),
        WITH_A_KNEE(past_the_trust_radius_the_way_is_cut),
        WITH_A_KNEE(an_answer_grows_old_then_is_lost),
        WITH_A_KNEE(a_long_way_makes_no_answer_old),
        WITH_A_KNEE(answers_to_forgotten_unsent_or_older_frames_are_dropped),
        WITH_A_KNEE(events_are_counted_even_of_dropped_answers),
        WITH_A_KNEE(a_lost_reply_loses_no_event),
        WITH_A_KNEE(counts_begin_anew_with_a_connection),
        WITH_A_KNEE(a_reply_that_had_no_room_for_counts_has_its_bits),
        WITH_A_KNEE(another_case_makes_all_answers_void),
        WITH_A_KNEE(an_instrument_that_an_answer_leaves_out_has_none),
        WITH_A_KNEE(a_lost_instrument_has_neither_pose),
        WITH_A_KNEE(a_held_loose_body_goes_along_and_has_no_place_without_its_holder),
        WITH_A_KNEE(a_loose_body_that_is_out_has_no_place_and_another_case_has_none),
        WITH_A_KNEE(bones_hang_on_the_femur_by_the_joint),
        WITH_A_KNEE(tracked_bones_are_where_they_are_seen_and_stay_there),
        WITH_A_KNEE(the_patella_follows_a_tracked_tibia_too),
        WITH_A_KNEE(without_a_knee_what_is_not_tracked_is_lost),
        WITH_A_KNEE(a_corrected_bone_is_shown_where_its_ligaments_let_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
