// What a session shows: static warp and torn ligaments composed on the surfaces, instruments as
// rigid bodies, and what of it a cut meets.
#include "step/session.h"

#include "base/clock.h"
#include "generated.h"
#include "random.h"
#include "step/scene_parts.h"
#include "test.h"

#include <string.h>

#define STEP_NS (10 * NS_PER_MS)
#define EXTRA_DEG 10.0

static struct scene *scene;
static const struct case_group *tibia, *meniscus;

static pose opened(const struct knee_case *knee, double flexion_deg, double varus_deg) {
    struct joint_angles joint = {.flexion_deg = flexion_deg, .varus_deg = varus_deg};
    return joint_to_pose(&knee->joint, &joint);
}

// The medial ligament: 5 degrees of valgus show as 15.
static void tear_ligament(struct knee_case *knee) {
    static const double flexion_deg[] = {15, 45, 65};
    knee->torn_count = 1;
    strcpy(knee->torn[0], "mcl");
    for (int i = 0; i < 3; i++)
        knee->keys[knee->key_count++] = (struct case_key){
            .physical = opened(knee, flexion_deg[i], -5),
            .target = opened(knee, flexion_deg[i], -5 - EXTRA_DEG),
        };
}

static int make_scene(void **state) {
    (void)state;
    struct error err;
    struct knee_case *knee = generated_knee(CASES "/tear-arthrosis");
    tear_ligament(knee);
    if (scene_create(&knee, &scene, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    tibia = case_group(scene->knee, "tibia");
    meniscus = case_group(scene->knee, "meniscus_medial");
    return 0;
}

static int drop_scene(void **state) {
    (void)state;
    scene_destroy(&scene);
    return 0;
}

// ---- a session by hand --------------------------------------------------------------------------

struct hand {
    struct session *session;
    struct session_input input;
    struct session_output out;
};

static void start(struct hand *h, const struct session_settings *settings) {
    *h = (struct hand){.session = session_create(scene, settings), .input.kind = INPUT_START};
    session_step(h->session, &h->input, &h->out);
}

// The joint at these angles, the femur where it is told, one instrument at T_femur_tip.
static const struct instrument_output *hold(struct hand *h, pose T_mockup_femur,
                                            struct joint_angles joint, enum channel channel,
                                            pose T_femur_tip) {
    uint64_t number = h->input.kind == INPUT_FRAME ? h->input.frame.number : 0;
    h->input.kind = INPUT_FRAME;
    h->input.time_ns += STEP_NS;
    struct frame *frame = &h->input.frame;
    *frame = (struct frame){.number = number + 1, .time_ns = h->input.time_ns};
    frame->samples[frame->count++] =
        (struct sample){.channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT, .joint = joint};
    frame->samples[frame->count++] = (struct sample){
        .channel = CHANNEL_FEMUR, .kind = SAMPLE_POSE, .T_mockup_body = T_mockup_femur};
    frame->samples[frame->count++] =
        (struct sample){.channel = channel,
                        .kind = SAMPLE_POSE,
                        .T_mockup_body = pose_compose(T_mockup_femur, T_femur_tip)};
    for (int i = 0; i < frame->count; i++)
        frame->samples[i].time_ns = h->input.time_ns;
    session_step(h->session, &h->input, &h->out);
    return &h->out.instruments[channel - CHANNEL_FIRST_INSTRUMENT];
}

static pose somewhere(struct random *r) {
    return (pose){quat_from_axis_angle(random_direction(r), random_between(r, 0, 3)),
                  random_in_box(r, 200)};
}

static pose tip_at(vec3 p) {
    return (pose){quat_from_axis_angle((vec3){1, 0, 0}, 2), p};
}

// Clear of every other surface of the case by 0.5 mm where the joint has these angles.
static bool is_alone(const struct scene_stance *stance, int group, vec3 p) {
    for (int i = 0; i < scene->knee->group_count; i++) {
        struct closest c;
        vec3 q = pose_apply_inverse(stance->T_femur_body[scene->knee->groups[i].body], p);
        if (i != group && query_closest(scene->queries[i], q, 0.5, MESH_NONE, &c))
            return false;
    }
    return true;
}

// ---- properties ---------------------------------------------------------------------------------

// A touch of vertex v of S is a touch of S' on the tibia where its ligaments let it.
static int touch_vertices(const struct case_group *group, struct joint_angles joint,
                          struct random *r, struct hand *h) {
    struct scene_stance stance;
    scene_stand(scene, ADAPTIVE_HINGE, &joint, &stance);
    int index = (int)(group - scene->knee->groups), touched = 0;
    pose T_mockup_femur = somewhere(r);
    for (uint32_t v = 0; v < group->mesh.vertex_count; v += 7) {
        vec3 x = mesh_vertex(&group->mesh, v);
        const float *u = group->warp + 3 * (size_t)v;
        vec3 target = vec3_add(x, (vec3){(double)u[0], (double)u[1], (double)u[2]});
        vec3 tip = pose_apply(stance.T_femur_body[BODY_TIBIA], x);
        if (!is_alone(&stance, index, tip))
            continue;
        const struct instrument_output *o =
            hold(h, T_mockup_femur, joint, CHANNEL_PROBE, tip_at(tip));
        vec3 shown = pose_apply(h->out.T_mockup_virtual[BODY_TIBIA], target);
        assert_vec3_near(o->T_mockup_warped.translation, shown, 1e-9);
        touched++;
    }
    return touched;
}

static void a_touch_of_the_tibia_is_one_of_the_virtual_tibia(void **state) {
    (void)state;
    struct random r = {1};
    struct session_settings settings = session_settings_default();
    for (int i = 0; i < 6; i++) {
        settings.field.kind = (enum field_kind)(FIELD_INVERSE_DISTANCE + i % 3);
        struct hand h;
        start(&h, &settings);
        struct joint_angles joint = {.flexion_deg = random_between(&r, 5, 70),
                                     .varus_deg = -random_between(&r, 2, 6)};
        assert_true(touch_vertices(tibia, joint, &r, &h) > 100);
        assert_true(touch_vertices(meniscus, joint, &r, &h) > 50);
        session_destroy(&h.session);
    }
}

static struct joint_angles shown_joint(const struct session_output *out) {
    pose T_femur_mockup = pose_inverse(out->T_mockup_virtual[BODY_FEMUR]);
    return joint_from_pose(&scene->knee->joint,
                           pose_compose(T_femur_mockup, out->T_mockup_virtual[BODY_TIBIA]));
}

static void the_virtual_tibia_meets_its_keys_and_rests_where_it_rested(void **state) {
    (void)state;
    struct random r = {2};
    struct session_settings settings = session_settings_default();
    struct hand h;
    start(&h, &settings);
    static const struct {
        double flexion_deg, varus_deg, shown_deg, share;
    } rows[] = {
        {15, -5, -15, 1}, {45, -5, -15, 1}, {65, -5, -15, 1}, {30, 0, 0, 0},
        {90, 0, 0, 0},    {45, 5, 5, 0},    {0, 0, 0, 0},     {45, -2.5, -7.5, 0.5},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct joint_angles joint = {.flexion_deg = rows[i].flexion_deg,
                                     .varus_deg = rows[i].varus_deg};
        hold(&h, somewhere(&r), joint, CHANNEL_PROBE, tip_at((vec3){0, 300, 0}));
        struct joint_angles shown = shown_joint(&h.out);
        assert_near(shown.flexion_deg, rows[i].flexion_deg, 1e-6);
        assert_near(shown.varus_deg, rows[i].shown_deg, 1e-6);
        assert_near(h.out.share[0], rows[i].share, 1e-9);
        assert_int_equal(h.out.torn_count, 1);
    }
    session_destroy(&h.session);
}

static void a_ligament_opens_by_the_ramp_of_the_rules(void **state) {
    (void)state;
    static const struct {
        int rules;
        double shares[3]; // at a fifth, at two fifths and at four fifths of an opening
    } rows[] = {{RULES_WITH_STRAIGHT_RAMP - 1, {0.104, 0.352, 0.896}},
                {RULES_WITH_STRAIGHT_RAMP, {0.125, 0.375, 0.875}}};
    for (int i = 0; i < 2; i++) {
        struct session_settings settings = session_settings_default();
        settings.rules = rows[i].rules;
        struct hand h;
        start(&h, &settings);
        for (int k = 0; k < 3; k++) {
            struct joint_angles joint = {.flexion_deg = 45, .varus_deg = -(1 << k)};
            hold(&h, pose_identity(), joint, CHANNEL_PROBE, tip_at((vec3){0, 300, 0}));
            assert_near(h.out.opening[0], 0.2 * (1 << k), 1e-9);
            assert_near(h.out.share[0], rows[i].shares[k], 1e-9);
            assert_near(shown_joint(&h.out).varus_deg, -(1 << k) - 10 * rows[i].shares[k], 1e-6);
        }
        session_destroy(&h.session);
    }
}

static void without_strength_nothing_is_displaced(void **state) {
    (void)state;
    struct session_settings settings = session_settings_default();
    settings.field.strength = 0;
    for (int mode = 0; mode < AVATAR_MODE_COUNT; mode++) {
        settings.avatar = (enum avatar_mode)mode;
        struct hand h;
        start(&h, &settings);
        struct joint_angles joint = {.flexion_deg = 45, .varus_deg = -5};
        vec3 tip = pose_apply(opened(scene->knee, 45, -5), mesh_vertex(&tibia->mesh, 5));
        const struct instrument_output *o =
            hold(&h, pose_identity(), joint, CHANNEL_PROBE, tip_at(tip));
        assert_vec3_near(o->T_mockup_warped.translation, o->T_mockup_tip.translation, 0);
        session_destroy(&h.session);
    }
}

// Through a portal, so deep; the portals of the case are in the femur's frame.
static pose through(int portal, vec3 aim, double depth_mm) {
    vec3 P = scene->knee->portals[portal].position, u = vec3_unit_or(vec3_sub(aim, P), aim);
    quat q = quat_unit((quat){1 + u.z, -u.y, u.x, 0}); // z into u
    return (pose){q, vec3_add_scaled(P, depth_mm, u)};
}

static double axis_misses(pose T_mockup_tip, vec3 p) {
    vec3 u = quat_rotate(T_mockup_tip.rotation, (vec3){0, 0, 1});
    vec3 way = vec3_sub(p, T_mockup_tip.translation);
    return vec3_length(vec3_add_scaled(way, -vec3_dot(way, u), u));
}

static void a_rigid_instrument_turns_in_the_portal_that_it_goes_through(void **state) {
    (void)state;
    struct random r = {3};
    struct session_settings settings = session_settings_default();
    settings.avatar = AVATAR_RIGID;
    struct hand h;
    start(&h, &settings);
    int turned = 0;
    assert_true(scene->knee->portal_count >= 2);
    for (int i = 0; i < 200; i++) {
        int portal = i / 100;
        enum channel channel = CHANNEL_FIRST_INSTRUMENT + i % INSTRUMENTS_USUAL;
        struct joint_angles joint = {.flexion_deg = 45, .varus_deg = -4};
        vec3 aim = vec3_add((vec3){-20, -5, -20}, random_in_box(&r, 8));
        pose T_mockup_femur = somewhere(&r);
        const struct instrument_output *o =
            hold(&h, T_mockup_femur, joint, channel, through(portal, aim, 30 + i % 30));
        vec3 P = pose_apply(T_mockup_femur, scene->knee->portals[portal].position);
        assert_int_equal(o->extrapolation.mode, AVATAR_RIGID);
        assert_vec3_near(o->extrapolation.portal, P, 1e-9);
        assert_true(axis_misses(o->T_mockup_warped, P) < 1e-6);
        turned += o->discrepancy.tilt_deg > 0.1;
        if (i % 100 == 99) // out, and to the other portal
            for (int k = 0; k < INSTRUMENTS_USUAL; k++)
                hold(&h, T_mockup_femur, joint, CHANNEL_FIRST_INSTRUMENT + k, through(1, aim, -20));
    }
    assert_true(turned > 50);
    session_destroy(&h.session);
}

// A shaft that is bent towards another portal has not changed to it, until it comes out.
static void an_instrument_keeps_its_portal_while_it_is_inside(void **state) {
    (void)state;
    struct session_settings settings = session_settings_default();
    settings.avatar = AVATAR_RIGID;
    struct hand h;
    start(&h, &settings);
    const struct case_portal *portals = scene->knee->portals;
    vec3 aside = vec3_sub(portals[1].position, portals[0].position), aim = {-20, -5, -20};
    assert_true(0.55 * vec3_length(aside) < 20);
    struct joint_angles joint = {.flexion_deg = 45};
    pose inside = through(0, aim, 20), outside = through(0, aim, -20);
    pose bent = {inside.rotation, vec3_add_scaled(inside.translation, 0.55, aside)};
    pose bent_outside = {outside.rotation, vec3_add_scaled(outside.translation, 0.55, aside)};
    const pose way[] = {inside, bent, bent_outside, bent};
    const int through_portal[] = {0, 0, 1, 1};
    for (int i = 0; i < 4; i++) {
        const struct instrument_output *o = hold(&h, pose_identity(), joint, CHANNEL_SCOPE, way[i]);
        assert_vec3_near(o->extrapolation.portal, portals[through_portal[i]].position, 1e-9);
    }
    session_destroy(&h.session);
}

// The blade is told in the virtual mesh: where the tip touches x of S, it is at x' of S'.
static void a_cut_is_made_on_the_virtual_tibia(void **state) {
    (void)state;
    struct session_settings settings = session_settings_default();
    struct hand h;
    start(&h, &settings);
    struct joint_angles joint = {.flexion_deg = 30, .varus_deg = -4};
    pose T_femur_tibia = opened(scene->knee, 30, -4);
    for (uint32_t v = 0; !h.out.job.id && v < 200; v++)
        hold(&h, pose_identity(), joint, CHANNEL_KNIFE,
             tip_at(pose_apply(T_femur_tibia, mesh_vertex(&meniscus->mesh, v))));
    assert_true(h.out.job.id);
    const struct instrument_output *o =
        &h.out.instruments[CHANNEL_KNIFE - CHANNEL_FIRST_INSTRUMENT];
    assert_int_equal(o->warp.nearest, meniscus - scene->knee->groups);
    vec3 in_mesh = h.out.job.moves[0].T_mesh_tip[1].translation;
    vec3 shown = pose_apply(h.out.T_mockup_virtual[BODY_TIBIA], in_mesh);
    assert_vec3_near(shown, o->T_mockup_warped.translation, 1e-9);
    assert_true(h.out.share[0] > 0.5);
    session_destroy(&h.session);
}

static void a_key_that_is_not_met_is_refused(void **state) {
    (void)state;
    struct knee_case *knee = generated_knee(CASES "/healthy");
    struct error err = {""};
    tear_ligament(knee);
    knee->keys[1].physical = opened(knee, 45, 0); // nothing is put to the test
    struct scene *refused = NULL;
    assert_int_not_equal(scene_create(&knee, &refused, &err), RESULT_OK);
    assert_non_null(strstr(err.text, "torn ligaments"));
    assert_null(refused);
    assert_non_null(knee);
    case_destroy(&knee);
}

// A frame of 10 ms each, closed `way_ns` before its step, with what was measured `late_ns` before
// that; then none. Returns the steps until the instrument is lost.
static int steps_until_lost(int rules, int64_t way_ns, int64_t late_ns) {
    struct session_settings settings = session_settings_default();
    settings.rules = rules;
    struct hand h;
    start(&h, &settings);
    h.input.time_ns = 2 * NS_PER_S;
    int steps = 0;
    for (int i = 0; i < 20; i++) {
        struct frame *frame = &h.input.frame;
        h.input.kind = INPUT_FRAME;
        h.input.time_ns += STEP_NS;
        *frame = (struct frame){.number = (uint64_t)i + 1, .count = 1};
        frame->time_ns = h.input.time_ns - way_ns;
        frame->samples[0] = (struct sample){.channel = CHANNEL_PROBE,
                                            .kind = SAMPLE_POSE,
                                            .time_ns = frame->time_ns - late_ns,
                                            .T_mockup_body = tip_at((vec3){0, 0, 200})};
        session_step(h.session, &h.input, &h.out);
        steps += h.out.instruments[0].present;
    }
    for (h.input.kind = INPUT_EMPTY; h.out.instruments[0].present; steps++) {
        h.input.time_ns += STEP_NS;
        session_step(h.session, &h.input, &h.out);
    }
    session_destroy(&h.session);
    return steps;
}

static void the_way_of_a_frame_makes_no_device_silent(void **state) {
    (void)state;
    for (int rules = RULES_WITHOUT_TRAVEL; rules <= RULES_NEWEST; rules++) {
        int steps = rules < RULES_HELD_FROM_FRAME ? 30 : 31; // 1 ms more
        assert_int_equal(steps_until_lost(rules, 0, NS_PER_MS), steps);
        assert_int_equal(steps_until_lost(rules, 300 * NS_PER_MS, NS_PER_MS), steps);
        assert_int_equal(steps_until_lost(rules, NS_PER_S, NS_PER_MS), steps);
        assert_int_equal(steps_until_lost(rules, 1200 * NS_PER_MS, NS_PER_MS), 0); // too old
    }
    int before = RULES_WITHOUT_TRAVEL - 1;
    assert_int_equal(steps_until_lost(before, 300 * NS_PER_MS, NS_PER_MS), 0);
}

static void a_device_that_tells_late_keeps_the_whole_hold(void **state) {
    (void)state;
    const int before = RULES_HELD_FROM_FRAME - 1;
    for (int64_t late_ms = 1; late_ms <= 1100; late_ms += 157)
        assert_int_equal(steps_until_lost(RULES_NEWEST, 300 * NS_PER_MS, late_ms * NS_PER_MS), 31);
    assert_int_equal(steps_until_lost(RULES_NEWEST, 0, 1101 * NS_PER_MS), 0); // too late
    assert_int_equal(steps_until_lost(before, 0, 60 * NS_PER_MS), 25);
    assert_int_equal(steps_until_lost(before, 0, 101 * NS_PER_MS), 0);
}

// A device of 5 Hz whose value is ok for 200 ms and, the last time, then held without end. Returns
// the steps in which the instrument was there.
static int steps_of_a_slow_device(int rules) {
    struct session_settings settings = session_settings_default();
    settings.rules = rules;
    struct hand h;
    start(&h, &settings);
    int there = 0;
    for (int i = 0; i < 100; i++) {
        struct frame *frame = &h.input.frame;
        h.input.kind = INPUT_FRAME;
        h.input.time_ns = NS_PER_S + i * STEP_NS;
        *frame = (struct frame){.number = (uint64_t)i + 1, .count = 1};
        frame->time_ns = h.input.time_ns;
        frame->samples[0] =
            (struct sample){.channel = CHANNEL_PROBE,
                            .kind = SAMPLE_POSE,
                            .validity = i < 60 ? VALIDITY_OK : VALIDITY_HELD,
                            .time_ns = NS_PER_S + (i < 60 ? i / 20 : 2) * 20 * STEP_NS,
                            .T_mockup_body = tip_at((vec3){0, 0, 200})};
        session_step(h.session, &h.input, &h.out);
        there += h.out.instruments[0].present;
    }
    session_destroy(&h.session);
    return there;
}

static void a_slow_device_is_there_until_it_was_held_for_the_hold(void **state) {
    (void)state;
    assert_int_equal(steps_of_a_slow_device(RULES_NEWEST), 60 + 10);
    assert_int_equal(steps_of_a_slow_device(RULES_HELD_FROM_FRAME - 1), 3 * 11);
}

static void press(struct random *r, enum validity validity, struct frame *frame) {
    for (enum channel c = CHANNEL_FEMUR; c <= CHANNEL_SCOPE; c++)
        frame->samples[frame->count++] = (struct sample){.channel = c,
                                                         .kind = SAMPLE_FORCE,
                                                         .validity = validity,
                                                         .time_ns = frame->time_ns,
                                                         .force_n = random_between(r, -50, 50)};
}

// Beside a session without gauges: the same steps to the bit. A gauge that is lost is a device that
// is lost, and nothing else.
static void a_force_moves_and_cuts_nothing(void **state) {
    (void)state;
    struct random r = {9};
    struct session_settings settings = session_settings_default();
    struct hand plain, pressed;
    start(&plain, &settings);
    start(&pressed, &settings);
    vec3 p = mesh_vertex(&meniscus->mesh, 0);
    for (int i = 0; i < 200; i++) {
        struct joint_angles joint = {.flexion_deg = 10 + 0.2 * i, .varus_deg = -0.02 * i};
        vec3 at = vec3_add(p, (vec3){0, 0, 20 - 0.2 * i});
        bool is_lost = i >= 150;
        hold(&plain, pose_identity(), joint, CHANNEL_KNIFE, tip_at(at));
        pressed.input = plain.input;
        press(&r, is_lost ? VALIDITY_LOST : (enum validity)(i % 2), &pressed.input.frame);
        session_step(pressed.session, &pressed.input, &pressed.out);
        if (is_lost)
            plain.out.hash = pressed.out.hash;
        if (i == 150) {
            assert_int_equal(pressed.out.events, plain.out.events | EVENT_DEVICE_LOST);
            plain.out.events = pressed.out.events;
        }
        assert_memory_equal(&pressed.out, &plain.out, sizeof plain.out);
    }
    session_destroy(&plain.session);
    session_destroy(&pressed.session);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_touch_of_the_tibia_is_one_of_the_virtual_tibia),
        cmocka_unit_test(the_virtual_tibia_meets_its_keys_and_rests_where_it_rested),
        cmocka_unit_test(a_ligament_opens_by_the_ramp_of_the_rules),
        cmocka_unit_test(without_strength_nothing_is_displaced),
        cmocka_unit_test(a_rigid_instrument_turns_in_the_portal_that_it_goes_through),
        cmocka_unit_test(an_instrument_keeps_its_portal_while_it_is_inside),
        cmocka_unit_test(a_cut_is_made_on_the_virtual_tibia),
        cmocka_unit_test(a_key_that_is_not_met_is_refused),
        cmocka_unit_test(the_way_of_a_frame_makes_no_device_silent),
        cmocka_unit_test(a_device_that_tells_late_keeps_the_whole_hold),
        cmocka_unit_test(a_slow_device_is_there_until_it_was_held_for_the_hold),
        cmocka_unit_test(a_force_moves_and_cuts_nothing),
    };
    return cmocka_run_group_tests_name("session", tests, make_scene, drop_scene);
}
