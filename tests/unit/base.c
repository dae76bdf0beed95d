#include "base/bytes.h"
#include "base/clock.h"
#include "base/history.h"
#include "base/joint.h"
#include "base/pose.h"
#include "base/ring.h"
#include "base/sample.h"
#include "random.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static void rotations_agree_with_their_matrices(void **state) {
    (void)state;
    struct random r = {1};
    for (int i = 0; i < 1000; i++) {
        pose p = random_pose(&r, 100);
        vec3 v = random_in_box(&r, 50);
        mat3 m = quat_to_mat3(p.rotation);
        assert_vec3_near(quat_rotate(p.rotation, v), mat3_apply(m, v), 1e-12);
        assert_near(mat3_determinant(m), 1, 1e-12);
        assert_near(mat3_norm(m), 1, 1e-9);
        assert_near(quat_angle(quat_from_mat3(m), p.rotation), 0, 1e-7);
    }
}

static void poses_compose_and_invert(void **state) {
    (void)state;
    struct random r = {2};
    for (int i = 0; i < 1000; i++) {
        pose a = random_pose(&r, 100), b = random_pose(&r, 100);
        vec3 v = random_in_box(&r, 50);
        assert_vec3_near(pose_apply(pose_compose(a, b), v), pose_apply(a, pose_apply(b, v)), 1e-11);
        assert_vec3_near(pose_apply(pose_inverse(a), pose_apply(a, v)), v, 1e-11);
        assert_vec3_near(pose_apply_inverse(a, pose_apply(a, v)), v, 1e-11);
    }
}

// exp by its power series on homogeneous matrices.
static void exponential(twist t, double out[4][4]) {
    vec3 w = t.rotation, u = t.translation;
    double x[4][4] = {{0, -w.z, w.y, u.x}, {w.z, 0, -w.x, u.y}, {-w.y, w.x, 0, u.z}, {0}};
    double term[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    memcpy(out, term, sizeof term);
    for (int n = 1; n < 60; n++) {
        double next[4][4] = {{0}};
        for (int i = 0; i < 64; i++)
            next[i / 16][i / 4 % 4] += term[i / 16][i % 4] * x[i % 4][i / 4 % 4] / n;
        memcpy(term, next, sizeof term);
        for (int i = 0; i < 16; i++)
            out[i / 4][i % 4] += term[i / 4][i % 4];
    }
}

static void twists_are_generators_of_motions(void **state) {
    (void)state;
    struct random r = {11};
    for (int i = 0; i < 2000; i++) {
        double angle = i % 2 ? random_between(&r, 0, 3.14) : pow(10, random_between(&r, -12, 0));
        twist t = {vec3_scale(angle, random_direction(&r)), random_in_box(&r, 50)};
        double m[4][4];
        exponential(t, m);
        pose p = pose_exp(t);
        vec3 v = random_in_box(&r, 50);
        assert_vec3_near(pose_apply(p, v),
                         ((vec3){m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z + m[0][3],
                                 m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z + m[1][3],
                                 m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z + m[2][3]}),
                         1e-11);
        quat q = p.rotation;
        pose same = {{-q.w, -q.x, -q.y, -q.z}, p.translation};
        for (int sign = 0; sign < 2; sign++) {
            twist back = pose_log(sign ? same : p);
            assert_vec3_near(back.rotation, t.rotation, 1e-12);
            assert_vec3_near(back.translation, t.translation, 1e-10);
        }
    }
    twist none = pose_log(pose_exp((twist){{0, 0, 0}, {1, 2, 3}}));
    assert_vec3_near(none.rotation, ((vec3){0, 0, 0}), 0);
    assert_vec3_near(none.translation, ((vec3){1, 2, 3}), 0);
}

// The largest stretch of any direction is never above the norm, and nearly reaches it.
static void the_norm_of_a_matrix_is_its_largest_stretch(void **state) {
    (void)state;
    struct random r = {3};
    for (int i = 0; i < 50; i++) {
        mat3 m;
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 3; column++)
                m.m[row][column] = random_between(&r, -2, 2);
        double norm = mat3_norm(m), largest = 0;
        for (int k = 0; k < 4000; k++)
            largest = fmax(largest, vec3_length(mat3_apply(m, random_direction(&r))));
        assert_true(largest <= norm * (1 + 1e-12));
        assert_true(largest >= norm * 0.98);
    }
}

static struct joint_frame some_joint(struct random *r, enum side side) {
    return (struct joint_frame){side, random_pose(r, 40), random_pose(r, 40)};
}

static void joint_angles_come_back_from_the_pose(void **state) {
    (void)state;
    struct random r = {4};
    for (int i = 0; i < 1000; i++) {
        struct joint_frame frame = some_joint(&r, i % 2 ? SIDE_LEFT : SIDE_RIGHT);
        struct joint_angles a = {random_between(&r, -20, 150), random_between(&r, -30, 30),
                                 random_between(&r, -40, 40),  random_between(&r, -9, 9),
                                 random_between(&r, -9, 9),    random_between(&r, -9, 9)};
        struct joint_angles b = joint_from_pose(&frame, joint_to_pose(&frame, &a));
        assert_near(a.flexion_deg, b.flexion_deg, 1e-9);
        assert_near(a.varus_deg, b.varus_deg, 1e-9);
        assert_near(a.internal_deg, b.internal_deg, 1e-9);
        assert_near(a.shift_mm, b.shift_mm, 1e-9);
        assert_near(a.drawer_mm, b.drawer_mm, 1e-9);
        assert_near(a.distraction_mm, b.distraction_mm, 1e-9);
    }
}

static vec3 foot_moves(enum side side, struct joint_angles a) {
    struct joint_frame frame = {side, pose_identity(), pose_identity()};
    vec3 foot = {0, 0, -400};
    return vec3_sub(pose_apply(joint_to_pose(&frame, &a), foot), foot);
}

// x is to the patient's right: towards lateral on a right knee, towards medial on a left one.
static void joint_angles_have_their_clinical_signs(void **state) {
    (void)state;
    assert_true(foot_moves(SIDE_RIGHT, (struct joint_angles){.flexion_deg = 30}).y < -100);
    assert_true(foot_moves(SIDE_LEFT, (struct joint_angles){.flexion_deg = 30}).y < -100);
    assert_true(foot_moves(SIDE_RIGHT, (struct joint_angles){.varus_deg = 10}).x < -50);
    assert_true(foot_moves(SIDE_LEFT, (struct joint_angles){.varus_deg = 10}).x > 50);
    assert_true(foot_moves(SIDE_RIGHT, (struct joint_angles){.drawer_mm = 5}).y > 4.9);
    assert_true(foot_moves(SIDE_RIGHT, (struct joint_angles){.distraction_mm = 5}).z < -4.9);
    assert_true(foot_moves(SIDE_RIGHT, (struct joint_angles){.shift_mm = 5}).x > 4.9);
    assert_true(foot_moves(SIDE_LEFT, (struct joint_angles){.shift_mm = 5}).x < -4.9);
    struct joint_frame right = {SIDE_RIGHT, pose_identity(), pose_identity()};
    struct joint_angles internal = {.internal_deg = 20};
    vec3 toes = pose_apply(joint_to_pose(&right, &internal), (vec3){0, 100, 0});
    assert_true(toes.x < -30);
}

static void history_says_how_it_knows_a_pose(void **state) {
    (void)state;
    struct history h = {0};
    pose p;
    assert_int_equal(history_at(&h, 5, 10, &p), HISTORY_NONE);
    for (int i = 1; i <= 40; i++) {
        pose at = pose_identity();
        at.translation.x = i;
        assert_true(history_add(&h, i * 100, at));
    }
    assert_false(history_add(&h, 4000, pose_identity()));
    assert_int_equal(history_at(&h, 3900, 50, &p), HISTORY_EXACT);
    assert_near(p.translation.x, 39, 1e-12);
    assert_int_equal(history_at(&h, 3925, 50, &p), HISTORY_INTERPOLATED);
    assert_near(p.translation.x, 39.25, 1e-12);
    assert_int_equal(history_at(&h, 4050, 50, &p), HISTORY_PREDICTED);
    assert_near(p.translation.x, 40.5, 1e-12);
    assert_int_equal(history_at(&h, 4051, 50, &p), HISTORY_NONE);
    assert_int_equal(history_at(&h, 2400, 50, &p), HISTORY_NONE);
    assert_int_equal(history_at(&h, 2500, 50, &p), HISTORY_EXACT);
}

// Whatever the delays of an exchange are, the true offset lies within the uncertainty.
static void add_ping(struct clock_offset *o, int64_t *now_ns, int64_t round_trip_ns) {
    int64_t received_ns = *now_ns + round_trip_ns + 500;
    assert_true(clock_offset_add(o, *now_ns, *now_ns + 7000, *now_ns + 7500, received_ns));
    *now_ns = received_ns + NS_PER_S;
}

static void one_slow_ping_does_not_change_the_round_trip(void **state) {
    (void)state;
    struct clock_offset o = {0};
    int64_t now_ns = 0;
    assert_int_equal(clock_offset_round_trip_ns(&o), 0);
    for (int i = 0; i < 9; i++)
        add_ping(&o, &now_ns, 200 + i);
    assert_int_equal(clock_offset_round_trip_ns(&o), 204);
    add_ping(&o, &now_ns, 50 * NS_PER_MS);
    assert_int_equal(clock_offset_round_trip_ns(&o), 204);
    for (int i = 0; i < CLOCK_OFFSET_WINDOW; i++)
        add_ping(&o, &now_ns, 900);
    assert_int_equal(clock_offset_round_trip_ns(&o), 900);
}

static void clock_offset_lies_within_its_uncertainty(void **state) {
    (void)state;
    struct random r = {5};
    for (int trial = 0; trial < 200; trial++) {
        struct clock_offset o = {0};
        int64_t offset, uncertainty, now = 1000000;
        assert_false(clock_offset_get(&o, now, &offset, &uncertainty));
        int64_t truth = (int64_t)random_between(&r, -1e12, 1e12);
        for (int i = 0; i < 30; i++) {
            int64_t there = (int64_t)random_between(&r, 1e4, 5e6);
            int64_t back = (int64_t)random_between(&r, 1e4, 5e6);
            assert_true(clock_offset_add(&o, now, now + there + truth, now + there + truth + 500,
                                         now + there + 500 + back));
            now += 100 * NS_PER_MS;
            assert_true(clock_offset_get(&o, now, &offset, &uncertainty));
            assert_true(llabs(offset - truth) <= uncertainty);
        }
        assert_false(clock_offset_add(&o, now, now, now + 100, now + 50));
    }
}

// The first exchange after a step tells of it, whichever way was the shortest before.
static void a_step_of_a_clock_is_noticed_at_once(void **state) {
    (void)state;
    static const int64_t steps_ms[] = {-2000, -150, 150, 2000};
    struct random r = {6};
    for (unsigned s = 0; s < sizeof steps_ms / sizeof *steps_ms; s++) {
        struct clock_offset o = {0};
        int64_t now = NS_PER_S, offset, uncertainty;
        for (int i = 0; i < 20; i++, now += NS_PER_S) {
            int64_t there = 100000 + (int64_t)random_between(&r, 0, i < 10 ? 1e6 : 20e6);
            int64_t truth = NS_PER_S * 70 + (i < 10 ? 0 : steps_ms[s] * NS_PER_MS);
            clock_offset_add(&o, now, now + there + truth, now + there + truth, now + 2 * there);
            assert_true(clock_offset_get(&o, now, &offset, &uncertainty));
            assert_true(llabs(offset - truth) <= uncertainty);
        }
    }
}

static void bytes_come_back_and_stay_in_bounds(void **state) {
    (void)state;
    uint8_t data[64];
    struct writer w = {data, sizeof data, 0, false};
    write_u8(&w, 0xab);
    write_u16(&w, 0x1234);
    write_u64(&w, 0x0102030405060708u);
    write_f64(&w, -NAN);
    write_text(&w, "tibia");
    assert_false(w.overflow);
    assert_int_equal(data[1], 0x34);
    char text[6];
    struct reader r = {data, w.used, 0, false};
    assert_int_equal(read_u8(&r), 0xab);
    assert_int_equal(read_u16(&r), 0x1234);
    assert_true(read_u64(&r) == 0x0102030405060708u);
    assert_true(isnan(read_f64(&r)));
    read_text(&r, text, sizeof text);
    assert_string_equal(text, "tibia");
    assert_false(r.underflow);
    assert_int_equal(read_u32(&r), 0);
    assert_true(r.underflow);
    uint8_t big[65] = {0};
    write_bytes(&w, big, sizeof big);
    assert_true(w.overflow);
}

static void a_ring_gives_back_in_order_and_refuses_when_full(void **state) {
    (void)state;
    struct ring *ring = ring_create(4, sizeof(int));
    int out;
    assert_false(ring_pop(ring, &out));
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i < 4; i++)
            assert_true(ring_push(ring, &i));
        assert_false(ring_push(ring, &round));
        for (int i = 0; i < 4; i++) {
            assert_true(ring_pop(ring, &out));
            assert_int_equal(out, i);
        }
    }
    ring_destroy(&ring);
    assert_null(ring);
}

static void frames_from_outside_are_checked(void **state) {
    (void)state;
    struct frame good = {.number = 1, .count = 1};
    good.samples[0] = (struct sample){.channel = CHANNEL_PROBE, .kind = SAMPLE_POSE};
    good.samples[0].T_mockup_body = pose_identity();
    assert_true(frame_is_valid(&good));
    struct frame bad = good;
    bad.count = FRAME_SAMPLES_MAX + 1;
    assert_false(frame_is_valid(&bad));
    bad = good;
    bad.samples[0].T_mockup_body.translation.y = NAN;
    assert_false(frame_is_valid(&bad));
    bad = good;
    bad.samples[0].T_mockup_body.rotation.w = 2;
    assert_false(frame_is_valid(&bad));
    bad = good;
    bad.samples[0].channel = CHANNEL_JOINT;
    assert_false(frame_is_valid(&bad));
    bad = good;
    bad.samples[0].kind = SAMPLE_HANDLE;
    bad.samples[0].handle = (struct handle){.opening = 1.01};
    assert_false(frame_is_valid(&bad));
}

static void forces_from_outside_are_checked(void **state) {
    (void)state;
    const struct {
        enum channel channel;
        double force_n;
        bool good;
    } rows[] = {
        {CHANNEL_PROBE, 8.5, true},  {CHANNEL_TIBIA, -1000, true},
        {CHANNEL_JOINT, 1, false},   {CHANNEL_PROBE, 1000.5, false},
        {CHANNEL_PROBE, NAN, false}, {CHANNEL_FEMUR, -INFINITY, false},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct frame frame = {.count = 1};
        frame.samples[0] = (struct sample){.channel = rows[i].channel, .kind = SAMPLE_FORCE};
        frame.samples[0].force_n = rows[i].force_n;
        assert_int_equal(frame_is_valid(&frame), rows[i].good);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_slow_ping_does_not_change_the_round_trip),
        cmocka_unit_test(rotations_agree_with_their_matrices),
        cmocka_unit_test(poses_compose_and_invert),
        cmocka_unit_test(twists_are_generators_of_motions),
        cmocka_unit_test(the_norm_of_a_matrix_is_its_largest_stretch),
        cmocka_unit_test(joint_angles_come_back_from_the_pose),
        cmocka_unit_test(joint_angles_have_their_clinical_signs),
        cmocka_unit_test(history_says_how_it_knows_a_pose),
        cmocka_unit_test(clock_offset_lies_within_its_uncertainty),
        cmocka_unit_test(a_step_of_a_clock_is_noticed_at_once),
        cmocka_unit_test(bytes_come_back_and_stay_in_bounds),
        cmocka_unit_test(a_ring_gives_back_in_order_and_refuses_when_full),
        cmocka_unit_test(frames_from_outside_are_checked),
        cmocka_unit_test(forces_from_outside_are_checked),
    };
    return cmocka_run_group_tests_name("base", tests, NULL, NULL);
}
