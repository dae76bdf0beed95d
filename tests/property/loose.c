// Loose bodies in sessions: they rest, are pushed, held, dropped and taken out, and never go into
// bone. Depths are measured at points of the ellipsoids, not as the step does it.
#include "step/loose.h"

#include "base/clock.h"
#include "generated.h"
#include "mesh/solid.h"
#include "random.h"
#include "step/loose_ground.h"
#include "step/session.h"
#include "test.h"

#include <math.h>
#include <string.h>

#define BODIES 3  // at places that hands reach
#define PINCHED 3 // and one where femur and tibia come together
#define GRASPER 5 // of the session's instruments
#define PROBE 0
#define DEEP_MM 0.3 // of an ellipsoid in bone, where the step takes the bone's nearest plane
#define ROWS 12
#define SOLIDS 5 // three bones, two menisci

static struct scene *scene;
static struct mesh meshes[SOLIDS];
static struct solid solids[SOLIDS];
static const enum body bodies[SOLIDS] = {BODY_FEMUR, BODY_TIBIA, BODY_PATELLA, BODY_TIBIA,
                                         BODY_TIBIA};

struct run {
    struct session *session;
    struct session_input input;
    struct session_output out;
    bool has_probe, has_grasper;
    pose probe, grasper;
    double opening, flexion_deg;
    uint32_t events;
};

static int make_scene(void **state) {
    (void)state;
    struct knee_case *knee = plain_knee(SIDE_RIGHT, 2, 3.5);
    struct error err;
    struct pathology step;
    pathology_init(&step, PATHOLOGY_LOOSE, "loose");
    assert_ok(pathology_take(&step, "count", "3", &err));
    assert_ok(pathology_check(&step, &err));
    if (pathology_apply(knee, &step, 0, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    knee->loose[knee->loose_count++] = (struct case_loose){
        .name = "pinched", .body = BODY_TIBIA, .at = {-21, 13, -22}, .radii_mm = {3, 3, 2}};
    static const char *const names[SOLIDS] = {"femur", "tibia", "patella", "meniscus_medial",
                                              "meniscus_lateral"};
    for (int i = 0; i < SOLIDS; i++) {
        case_group_virtual(case_group(knee, names[i]), &meshes[i]);
        assert_ok(solid_init(&solids[i], &meshes[i], &err));
    }
    if (scene_create(&knee, &scene, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return 0;
}

static int drop_scene(void **state) {
    (void)state;
    scene_destroy(&scene);
    for (int i = 0; i < SOLIDS; i++) {
        solid_fini(&solids[i]);
        mesh_fini(&meshes[i]);
    }
    return 0;
}

// ---- a run --------------------------------------------------------------------------------------

static void add(struct run *r, struct sample sample) {
    sample.time_ns = r->input.time_ns;
    r->input.frame.samples[r->input.frame.count++] = sample;
}

static void step(struct run *r) {
    struct frame *frame = &r->input.frame;
    r->input.kind = INPUT_FRAME;
    r->input.time_ns += 10 * NS_PER_MS;
    *frame = (struct frame){.number = frame->number + 1, .time_ns = r->input.time_ns};
    add(r, (struct sample){.channel = CHANNEL_JOINT,
                           .kind = SAMPLE_JOINT,
                           .joint = {.flexion_deg = r->flexion_deg}});
    if (r->has_probe)
        add(r, (struct sample){
                   .channel = CHANNEL_PROBE, .kind = SAMPLE_POSE, .T_mockup_body = r->probe});
    if (r->has_grasper) {
        enum channel channel = CHANNEL_FIRST_INSTRUMENT + GRASPER;
        add(r,
            (struct sample){.channel = channel, .kind = SAMPLE_POSE, .T_mockup_body = r->grasper});
        add(r, (struct sample){
                   .channel = channel, .kind = SAMPLE_HANDLE, .handle = {.opening = r->opening}});
    }
    session_step(r->session, &r->input, &r->out);
    r->events |= r->out.events;
}

static void command(struct run *r, enum input_kind kind) {
    r->input.kind = kind;
    session_step(r->session, &r->input, &r->out);
}

static struct run start(void) {
    struct session_settings settings = session_settings_default();
    struct instrument grasper = instrument_grasper();
    struct error err;
    assert_ok(instruments_add(&settings.instruments, &grasper, &err));
    struct run r = {.session = session_create(scene, &settings), .flexion_deg = 20};
    command(&r, INPUT_START);
    for (int i = 0; i < 50; i++)
        step(&r);
    return r;
}

static vec3 place(const struct run *r, int i) {
    return r->out.loose[i].T_mockup_loose.translation;
}

// ---- measures -----------------------------------------------------------------------------------

static const struct case_loose *loose(int i) {
    return &scene_case(scene)->loose[i];
}

// The signed distance of the ellipsoid's nearest point to a bone or meniscus of the patient.
static double gap_to(const struct run *r, int i, int solid) {
    vec3 radii = loose(i)->radii_mm;
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    for (int k = 0; k <= ROWS; k++)
        for (int m = 0; m < 2 * ROWS; m++) {
            double a = M_PI * k / ROWS, b = M_PI * m / ROWS;
            vec3 p = {radii.x * sin(a) * cos(b), radii.y * sin(a) * sin(b), radii.z * cos(a)};
            vec3 at = pose_apply_inverse(r->out.T_mockup_virtual[bodies[solid]],
                                         pose_apply(r->out.loose[i].T_mockup_loose, p));
            least = fmin(least, solid_distance(&solids[solid], at, &hint));
        }
    return least;
}

static double least_gap(const struct run *r, int i, int count) {
    double least = INFINITY;
    for (int solid = 0; solid < count; solid++)
        least = fmin(least, gap_to(r, i, solid));
    return least;
}

static void none_is_in_bone(const struct run *r) {
    for (int i = 0; i <= PINCHED; i++)
        if (r->out.loose[i].state == LOOSE_LYING)
            assert_true(least_gap(r, i, BODY_COUNT) > -DEEP_MM);
}

static void it_lies_on_something(const struct run *r, int i) {
    double gap = least_gap(r, i, SOLIDS);
    assert_int_equal(r->out.loose[i].state, LOOSE_LYING);
    assert_true(gap > -DEEP_MM && gap < DEEP_MM);
}

// Away from the surface that the body lies on.
static vec3 up_from(const struct run *r, int i) {
    vec3 z = quat_rotate(r->out.loose[i].T_mockup_loose.rotation, (vec3){0, 0, 1});
    vec3 out = vec3_add_scaled(place(r, i), 1, z);
    const struct solid *bone = &solids[r->out.loose[i].carrier];
    const pose *T = &r->out.T_mockup_virtual[r->out.loose[i].carrier];
    uint32_t hint = MESH_NONE;
    double here = solid_distance(bone, pose_apply_inverse(*T, place(r, i)), &hint);
    double there = solid_distance(bone, pose_apply_inverse(*T, out), &hint);
    return there > here ? z : vec3_scale(-1, z);
}

// A shaft whose tip is there, upright on the surface: only the tip is near it.
static pose upright(vec3 tip, vec3 up) {
    vec3 z = vec3_scale(-1, up), aside = fabs(z.x) < 0.7 ? (vec3){1, 0, 0} : (vec3){0, 1, 0};
    vec3 x = vec3_unit_or(vec3_cross(aside, z), aside), y = vec3_cross(z, x);
    return (pose){quat_from_mat3((mat3){{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}}), tip};
}

// ---- tests --------------------------------------------------------------------------------------

static void what_nothing_touches_rests(void **state) {
    (void)state;
    struct run r = start();
    struct session_output first = r.out;
    for (int i = 0; i < 300; i++)
        step(&r);
    assert_memory_equal(r.out.loose, first.loose, sizeof first.loose);
    for (int i = 0; i < BODIES; i++)
        it_lies_on_something(&r, i);
    session_destroy(&r.session);
}

static void a_moving_joint_does_not_press_them_into_bone(void **state) {
    (void)state;
    struct run r = start();
    for (int i = 0; i <= 400; i++) { // to 0, to 110, and back to 45 degrees
        r.flexion_deg = i <= 40 ? 20 - 0.5 * i : i <= 260 ? 0.5 * (i - 40) : 110 - 0.5 * (i - 260);
        step(&r);
        if (i % 5 == 0)
            none_is_in_bone(&r);
    }
    session_destroy(&r.session);
}

static void a_tip_pushes_them_away(void **state) {
    (void)state;
    for (int i = 0; i < BODIES; i++) {
        struct run r = start();
        vec3 before = place(&r, i), up = up_from(&r, i);
        vec3 side = vec3_unit_or(vec3_cross(up, (vec3){0.3, 0.8, 0.1}), up);
        r.has_probe = true;
        for (int k = 0; k <= 100; k++) {
            r.probe = upright(vec3_add_scaled(before, -8 + 0.08 * k, side), up);
            step(&r);
            none_is_in_bone(&r);
        }
        assert_true(vec3_dot(vec3_sub(place(&r, i), before), side) > 2);
        assert_true(vec3_distance(place(&r, i), r.probe.translation) > 2);
        vec3 pushed = place(&r, i);
        r.probe.translation = vec3_add_scaled(before, 60, up);
        for (int k = 0; k < 100; k++)
            step(&r);
        assert_true(vec3_distance(place(&r, i), pushed) < 1);
        none_is_in_bone(&r);
        session_destroy(&r.session);
    }
}

static void reach(struct run *r, vec3 tip, vec3 up, int steps) {
    pose from = r->grasper;
    for (int k = 1; k <= steps; k++) {
        r->grasper = upright(vec3_lerp(from.translation, tip, (double)k / steps), up);
        step(r);
    }
}

static void open_to(struct run *r, double opening) {
    double from = r->opening;
    for (int k = 1; k <= 20; k++) {
        r->opening = from + (opening - from) * k / 20;
        step(r);
    }
}

// From above, the jaw round it.
static void grasp(struct run *r, int i) {
    vec3 up = up_from(r, i);
    r->has_grasper = true;
    r->opening = 1;
    r->grasper = upright(vec3_add_scaled(place(r, i), 20, up), up);
    step(r);
    reach(r, place(r, i), up, 50);
    open_to(r, 0.2);
    assert_int_equal(r->out.loose[i].state, LOOSE_HELD);
    assert_int_equal(r->out.loose[i].carrier, BODY_COUNT + GRASPER);
    assert_true(r->events & EVENT_GRASPED);
}

static void a_jaw_that_closes_holds_and_one_that_opens_drops(void **state) {
    (void)state;
    struct run r = start();
    vec3 up = up_from(&r, 1), before = place(&r, 1);
    grasp(&r, 1);
    reach(&r, vec3_add_scaled(before, 6, up), up, 40);
    assert_true(vec3_dot(vec3_sub(place(&r, 1), before), up) > 4);
    assert_false(r.events & EVENT_DROPPED);
    open_to(&r, 1);
    assert_true(r.events & EVENT_DROPPED);
    reach(&r, vec3_add_scaled(before, 40, up), up, 60);
    for (int k = 0; k < 100; k++)
        step(&r);
    it_lies_on_something(&r, 1);
    session_destroy(&r.session);
}

static void a_closed_jaw_takes_nothing(void **state) {
    (void)state;
    struct run r = start();
    vec3 up = up_from(&r, 1);
    r.has_grasper = true;
    r.grasper = upright(vec3_add_scaled(place(&r, 1), 20, up), up);
    step(&r);
    reach(&r, vec3_add_scaled(place(&r, 1), 1, up), up, 50);
    open_to(&r, 0.5);
    open_to(&r, 0);
    assert_false(r.events & EVENT_GRASPED);
    session_destroy(&r.session);
}

// Along the shaft through its portal, where nothing is in the way.
static void take_out(struct run *r, int i, int portal) {
    const struct case_portal *p = &scene_case(scene)->portals[portal];
    vec3 up = vec3_unit_or(vec3_sub(p->position, place(r, i)), (vec3){0, 0, 1});
    r->has_grasper = true;
    r->opening = 1;
    r->grasper = upright(vec3_add_scaled(p->position, 10, up), up);
    step(r);
    reach(r, place(r, i), up, 200);
    open_to(r, 0.2);
    reach(r, vec3_add_scaled(p->position, 15, up), up, 200);
}

static void what_passes_the_portal_is_out(void **state) {
    (void)state;
    for (int i = 0; i < BODIES; i++) {
        bool is_out = false;
        for (int portal = 0; portal < 2 && !is_out; portal++) {
            struct run r = start();
            take_out(&r, i, portal);
            is_out = r.out.loose[i].state == LOOSE_OUT;
            assert_true(!is_out || session_is_changed(r.session));
            assert_true(is_out == ((r.events & EVENT_TAKEN_OUT) != 0));
            open_to(&r, 1);
            assert_true(!is_out || r.out.loose[i].state == LOOSE_OUT);
            command(&r, INPUT_RESET);
            step(&r);
            assert_int_equal(r.out.loose[i].state, LOOSE_LYING);
            session_destroy(&r.session);
        }
        assert_true(is_out);
    }
}

// Whatever hands do, twice: the same bits, and nothing in bone.
static void wander(struct run *r, uint64_t seed) {
    struct random chance = {seed};
    r->has_probe = r->has_grasper = true;
    r->grasper = r->probe = (pose){quat_identity(), {0, 40, 0}};
    for (int k = 0; k < 60; k++) {
        int i = (int)(random_bits(&chance) % BODIES);
        vec3 up = up_from(r, i),
             beside = {random_between(&chance, -4, 4), random_between(&chance, -4, 4),
                       random_between(&chance, -4, 4)};
        vec3 from = r->probe.translation, to = vec3_add(place(r, i), beside);
        r->opening = random_between(&chance, 0, 1);
        for (int m = 1; m <= 15; m++) {
            r->probe = upright(vec3_lerp(from, to, m / 15.0), up);
            r->grasper = upright(vec3_add_scaled(r->probe.translation, 3, beside), up);
            step(r);
        }
        none_is_in_bone(r);
    }
}

static void the_same_hands_give_the_same_bits(void **state) {
    (void)state;
    uint64_t hashes[2];
    for (int i = 0; i < 2; i++) {
        struct run r = start();
        wander(&r, 7);
        hashes[i] = r.out.hash;
        session_destroy(&r.session);
    }
    assert_true(hashes[0] == hashes[1]);
}

static void a_paused_session_moves_none(void **state) {
    (void)state;
    struct run r = start();
    vec3 before = place(&r, 0), up = up_from(&r, 0);
    command(&r, INPUT_PAUSE);
    r.has_probe = true;
    r.probe = upright(before, up);
    for (int k = 0; k < 20; k++)
        step(&r);
    assert_true(vec3_distance(place(&r, 0), before) == 0);
    session_destroy(&r.session);
}

// What earlier answers leave out would not have been the nearest.
static void earlier_answers_change_no_answer(void **state) {
    (void)state;
    struct random chance = {11};
    struct loose_ground *ground;
    struct loose_hints kept, none;
    struct error err;
    assert_ok(loose_ground_create(scene_case(scene), &ground, &err));
    loose_hints_init(&kept);
    pose T_mockup_body[BODY_COUNT] = {pose_identity(), pose_identity(), pose_identity()};
    pose T = {quat_identity(), {-21, 13, -20}};
    const vec3 radii = {3.5, 3, 2};
    for (int k = 0; k < 3000; k++) {
        double far_mm = k % 100 ? 1 : 30;
        T.translation = vec3_add(k % 500 ? T.translation : (vec3){-21, 13, -20},
                                 random_in_box(&chance, far_mm));
        T_mockup_body[BODY_TIBIA].translation = random_in_box(&chance, 0.5);
        T_mockup_body[BODY_PATELLA].translation = random_in_box(&chance, 0.5);
        loose_hints_init(&none);
        struct loose_contact with = loose_nearest(ground, 0, T_mockup_body, radii, T, &kept);
        struct loose_contact without = loose_nearest(ground, 0, T_mockup_body, radii, T, &none);
        assert_int_equal(with.surface, without.surface);
        assert_true(with.surface < 0 || fabs(with.gap - without.gap) < 1e-9);
    }
    loose_ground_destroy(&ground);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(earlier_answers_change_no_answer),
        cmocka_unit_test(what_nothing_touches_rests),
        cmocka_unit_test(a_moving_joint_does_not_press_them_into_bone),
        cmocka_unit_test(a_tip_pushes_them_away),
        cmocka_unit_test(a_jaw_that_closes_holds_and_one_that_opens_drops),
        cmocka_unit_test(a_closed_jaw_takes_nothing),
        cmocka_unit_test(what_passes_the_portal_is_out),
        cmocka_unit_test(the_same_hands_give_the_same_bits),
        cmocka_unit_test(a_paused_session_moves_none),
    };
    return cmocka_run_group_tests(tests, make_scene, drop_scene);
}
