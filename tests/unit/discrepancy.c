#include "step/discrepancy.h"

#include "random.h"
#include "test.h"

// A extrapolation of the tip whose motion is F = I + slope.
static struct avatar_extrapolation lead_of(mat3 F, vec3 offset) {
    struct avatar_extrapolation extrapolation = {.motion = {.v = offset}, .trust_radius_mm = 1};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            extrapolation.slope[i][k] = F.m[i][k] - (i == k);
    return extrapolation;
}

static struct discrepancy meet(mat3 F, vec3 offset) {
    struct avatar_extrapolation extrapolation = lead_of(F, offset);
    pose tip = {quat_from_axis_angle((vec3){0, 1, 0}, 0.4), {3, -4, 5}};
    return discrepancy_of(
        &extrapolation, tip,
        avatar_place(extrapolation.mode, extrapolation.portal, &extrapolation.motion, tip), false);
}

static mat3 diagonal(double a, double b, double c) {
    return (mat3){{{a, 0, 0}, {0, b, 0}, {0, 0, c}}};
}

// F = R U with U stretched along axes of its own: its gains and its rotation are known.
static void gains_and_turn_are_those_of_the_polar_parts(void **state) {
    (void)state;
    struct random r = {1};
    for (int i = 0; i < 500; i++) {
        double angle = random_between(&r, 0, 2.5), least = random_between(&r, 0.05, 1);
        double middle = random_between(&r, least, 1.5), most = random_between(&r, middle, 4);
        mat3 R = quat_to_mat3(quat_from_axis_angle(random_direction(&r), angle));
        mat3 V = quat_to_mat3(quat_from_axis_angle(random_direction(&r), random_between(&r, 0, 3)));
        mat3 U = mat3_multiply(mat3_multiply(V, diagonal(middle, most, least)), mat3_transpose(V));
        vec3 offset = random_in_box(&r, 3);
        struct discrepancy d = meet(mat3_multiply(R, U), offset);
        assert_near(d.gain, most, 1e-7);
        assert_near(d.gain_least, least, 1e-6);
        assert_near(d.turn_deg, DEG_PER_RAD * angle, 1e-6);
        assert_near(d.offset_mm, vec3_length(offset), 1e-12);
        assert_near(d.tilt_deg, 0, 1e-6);
    }
}

static void a_fold_has_a_negative_gain_and_is_turned_right_round(void **state) {
    (void)state;
    struct discrepancy d = meet(diagonal(1, 2, -0.25), (vec3){0, 0, 0});
    assert_near(d.gain, 2, 1e-9);
    assert_near(d.gain_least, -0.25, 1e-9);
    assert_near(d.turn_deg, 180, 0);
    assert_true(discrepancy_is_noticed(&d));
}

// Against differences over the whole path of hand, network and picture: a turn in the portal.
static void a_rigid_avatars_shaft_tilts(void **state) {
    (void)state;
    struct avatar_extrapolation extrapolation = {.mode = AVATAR_RIGID,
                                                 .portal = {0, 0, -50},
                                                 .motion = {{tan(0.1), 0, 0}, 2},
                                                 .trust_radius_mm = 1};
    pose tip = pose_identity(),
         shown = avatar_place(AVATAR_RIGID, extrapolation.portal, &extrapolation.motion, tip);
    struct discrepancy d = discrepancy_of(&extrapolation, tip, shown, false);
    assert_near(d.tilt_deg, 0.1 * DEG_PER_RAD, 1e-9);
    assert_near(d.offset_mm, vec3_distance(shown.translation, (vec3){0, 0, 0}), 1e-12);
    assert_near(shown.translation.x, 52 * sin(0.1), 1e-9);
}

static struct avatar_extrapolation any_extrapolation(struct random *r, enum avatar_mode mode) {
    struct avatar_extrapolation extrapolation = {.mode = mode,
                                                 .portal = random_in_box(r, 60),
                                                 .motion = {.v = random_in_box(r, 0.3)},
                                                 .reach_mm = 49,
                                                 .trust_radius_mm = 0.5};
    extrapolation.motion.s = mode == AVATAR_RIGID ? random_between(r, -3, 3) : 0;
    double most = mode == AVATAR_RIGID ? 0.004 : 0.4; // v is a part of 1 of tens of mm
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 6; k++)
            extrapolation.slope[i][k] = random_between(r, -most, most);
    for (int k = 0; mode == AVATAR_RIGID && k < 6; k++)
        extrapolation.slope[3][k] = random_between(r, -0.4, 0.4);
    return extrapolation;
}

static void the_derivative_is_the_limit_of_differences(void **state) {
    (void)state;
    struct random r = {3};
    for (int i = 0; i < 3000; i++) {
        struct avatar_extrapolation extrapolation =
            any_extrapolation(&r, (enum avatar_mode)(i % AVATAR_MODE_COUNT));
        pose tip = {quat_from_axis_angle(random_direction(&r), random_between(&r, 0, 3)),
                    random_in_box(&r, 40)};
        pose shown =
            avatar_place(extrapolation.mode, extrapolation.portal, &extrapolation.motion, tip);
        struct discrepancy d = discrepancy_of(&extrapolation, tip, shown, false),
                           expected = discrepancy_of(&extrapolation, tip, shown, true);
        assert_near(d.gain, expected.gain, 1e-6);
        assert_near(d.gain_least, expected.gain_least, 1e-6);
        assert_near(d.turn_deg, expected.turn_deg, 1e-5);
        assert_true(d.offset_mm == expected.offset_mm && d.tilt_deg == expected.tilt_deg);
    }
}

static void what_is_noticed_is_past_a_threshold(void **state) {
    (void)state;
    static const struct {
        struct discrepancy d;
        bool noticed;
    } rows[] = {
        {{9, 0, 1, 1, 0}, false},   {{0, 4.4, 1.06, 0.89, 4.4}, false}, {{0, 4.6, 1, 1, 0}, true},
        {{0, 0, 1.08, 1, 0}, true}, {{0, 0, 1, 0.87, 0}, true},         {{0, 0, 1, 1, 4.6}, true},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        assert_int_equal(discrepancy_is_noticed(&rows[i].d), rows[i].noticed);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gains_and_turn_are_those_of_the_polar_parts),
        cmocka_unit_test(a_fold_has_a_negative_gain_and_is_turned_right_round),
        cmocka_unit_test(a_rigid_avatars_shaft_tilts),
        cmocka_unit_test(the_derivative_is_the_limit_of_differences),
        cmocka_unit_test(what_is_noticed_is_past_a_threshold),
    };
    return cmocka_run_group_tests_name("discrepancy", tests, NULL, NULL);
}
