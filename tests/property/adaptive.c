#include "random.h"
#include "scene/torn.h"
#include "test.h"

static void assert_no_extra(struct joint_angles extra, double tolerance) {
    assert_near(extra.flexion_deg, 0, tolerance);
    assert_near(extra.varus_deg, 0, tolerance);
    assert_near(extra.internal_deg, 0, tolerance);
    assert_near(extra.shift_mm, 0, tolerance);
    assert_near(extra.drawer_mm, 0, tolerance);
    assert_near(extra.distraction_mm, 0, tolerance);
}

// ---- keys ----

static void assert_only_its_own_opens(const struct torn *knee, const struct adaptive_key *key) {
    struct adaptive_warp warp;
    adaptive_at(knee->adaptive, ADAPTIVE_RAMP_STRAIGHT, key->T_femur_tibia, &warp);
    pose seen = pose_compose(warp.correction, key->T_femur_tibia);
    assert_near(torn_apart(knee, seen, key->target), 0, 1e-9);
    for (int i = 0; i < ADAPTIVE_LIGAMENTS_MAX; i++) {
        assert_near(warp.share[i], i == key->ligament, 1e-9);
        assert_true(i == key->ligament || warp.opening[i] < 1e-9);
    }
}

// Of three or more, one may open as others do together: rarely.
static void every_recorded_key_is_met_and_opens_nothing_else(void **state) {
    (void)state;
    struct random r = {1};
    int refused = 0;
    for (int trial = 0; trial < 300; trial++) {
        struct torn knee;
        torn_start(&knee, torn_joint(&r));
        unsigned torn = (unsigned)trial % 15 + 1; // all sets of four ligaments
        for (int ligament = 0; ligament < 4; ligament++)
            for (int k = 0; k < 3 && torn >> ligament & 1; k++)
                torn_add_recorded(&knee, &r, ligament, 20 + 30 * k + random_between(&r, -8, 8));
        if (adaptive_create(&knee.setup, &knee.adaptive, NULL) != RESULT_OK) {
            assert_true(__builtin_popcount(torn) > 2);
            refused++;
            continue;
        }
        assert_int_equal(adaptive_check(knee.adaptive, NULL), RESULT_OK);
        for (int k = 0; k < knee.setup.key_count; k++)
            assert_only_its_own_opens(&knee, &knee.keys[k]);
        torn_destroy(&knee);
    }
    assert_true(refused < 10);
}

static void keys_are_met_beside_a_rest_path_of_coupled_motions(void **state) {
    (void)state;
    struct random r = {2};
    struct torn knee;
    torn_start(&knee, torn_joint(&r));
    torn_add_rest_path(&knee, 13);
    for (int k = 0; k < 3; k++)
        torn_add_recorded(&knee, &r, ACL, 15 + 25 * k);
    torn_build(&knee, ADAPTIVE_HINGE);
    for (int k = 0; k < 3; k++)
        assert_true(torn_apart(&knee, torn_seen(&knee, knee.keys[k].T_femur_tibia),
                               knee.keys[k].target) < 1e-9);
    torn_destroy(&knee);
}

// ---- where nothing may open ----

static void nothing_opens_at_rest(void **state) {
    (void)state;
    struct random r = {3};
    struct torn knee;
    torn_create(&knee, &r, true, true);
    for (int i = 0; i <= 1200; i++) {
        pose A = torn_pose(&knee, (struct joint_angles){.flexion_deg = 0.1 * i});
        assert_true(torn_apart(&knee, torn_seen(&knee, A), A) < 1e-9);
    }
    torn_destroy(&knee);
}

// The true path between two keys is not the cubic's: with one each 10 degrees, nearly.
static void nothing_opens_on_a_rest_path_through_keys(void **state) {
    (void)state;
    struct random r = {4};
    struct torn knee, path;
    torn_start(&knee, torn_joint(&r));
    torn_add_rest_path(&knee, 13);
    for (int k = 0; k < 3; k++)
        torn_add_recorded(&knee, &r, MCL, 15 + 25 * k);
    torn_build(&knee, ADAPTIVE_HINGE);
    torn_start(&path, knee.setup.joint);
    torn_add_rest_path(&path, 31);
    for (int i = 0; i < knee.setup.rest_count; i++)
        assert_true(torn_apart(&knee, torn_seen(&knee, knee.rest[i]), knee.rest[i]) < 1e-9);
    for (int i = 0; i < path.setup.rest_count; i++)
        assert_true(torn_apart(&knee, torn_seen(&knee, path.rest[i]), path.rest[i]) < 0.005);
    torn_destroy(&knee);
}

static void nothing_opens_the_other_way(void **state) {
    (void)state;
    struct random r = {5};
    struct torn knee;
    torn_create(&knee, &r, true, true);
    for (int i = 0; i < 500; i++) {
        double f = random_between(&r, -5, 130);
        struct joint_angles varus = {.flexion_deg = f, .varus_deg = random_between(&r, 0, 15)};
        struct joint_angles back = {.flexion_deg = f, .drawer_mm = random_between(&r, -15, 0)};
        assert_no_extra(torn_extra(&knee, varus), 1e-6);
        assert_no_extra(torn_extra(&knee, back), 1e-6);
        varus.drawer_mm = back.drawer_mm;
        assert_no_extra(torn_extra(&knee, varus), 1e-6);
    }
    torn_destroy(&knee);
}

// ---- how far it opens ----

static void an_opening_between_and_past_the_keys_is_theirs(void **state) {
    (void)state;
    struct random r = {6};
    struct torn knee;
    torn_create(&knee, &r, true, false);
    for (double f = 15; f <= 65; f += 0.25) {
        struct joint_angles extra =
            torn_extra(&knee, (struct joint_angles){.flexion_deg = f, .varus_deg = -6});
        assert_near(extra.varus_deg, -10, 0.005);
        extra.varus_deg = 0;
        assert_no_extra(extra, 1e-6);
    }
    for (double f = -5; f <= 130; f += 1)
        assert_near(torn_extra_valgus(&knee, f, 6), 10, 1e-6);
    torn_destroy(&knee);
}

static void half_of_an_opening_gives_half(void **state) {
    (void)state;
    struct random r = {7};
    struct torn knee;
    torn_create(&knee, &r, true, true);
    for (double f = 0; f <= 120; f += 5) {
        assert_near(torn_extra_valgus(&knee, f, 3), 5, 1e-6);
        struct joint_angles drawer = {.flexion_deg = f, .drawer_mm = 3};
        assert_near(torn_extra(&knee, drawer).drawer_mm, 2.5, 1e-6);
    }
    torn_destroy(&knee);
}

static void more_opening_never_gives_less_nor_more_than_the_key(void **state) {
    (void)state;
    struct random r = {8};
    struct torn knee;
    torn_create(&knee, &r, true, false);
    for (double f = 0; f <= 120; f += 10) {
        double last = 0;
        for (double valgus = 0; valgus <= 20; valgus += 0.1) {
            double extra = torn_extra_valgus(&knee, f, valgus);
            assert_true(extra >= last - 1e-9 && extra <= 10 * 1.001);
            last = extra;
        }
        assert_near(last, 10, 0.01);
    }
    torn_destroy(&knee);
}

// What is given of the extra motion, at an opening.
static double share_at(const struct torn *knee, enum adaptive_ramp ramp, double opening) {
    struct adaptive_warp warp;
    struct joint_angles joint = {.flexion_deg = 45, .varus_deg = -6 * opening};
    adaptive_at(knee->adaptive, ramp, torn_pose(knee, joint), &warp);
    assert_near(warp.opening[MCL], opening, 1e-9);
    return warp.share[MCL];
}

static void the_ramp_is_straight_but_at_its_ends_and_once_was_a_cubic(void **state) {
    (void)state;
    struct random r = {15};
    struct torn knee;
    torn_create(&knee, &r, true, false);
    double steepest = 0, step = 1e-3;
    for (double s = -0.1; s <= 1.1; s += step) {
        double share = share_at(&knee, ADAPTIVE_RAMP_STRAIGHT, s);
        double slope = (share_at(&knee, ADAPTIVE_RAMP_STRAIGHT, s + step) - share) / step;
        steepest = fmax(steepest, slope);
        assert_true(slope >= -1e-6);
        if (s > 0.2 && s < 0.8)
            assert_near(share, 0.5 + 1.25 * (s - 0.5), 1e-9);
        if (s > 0 && s < 1)
            assert_near(share_at(&knee, ADAPTIVE_RAMP_CUBIC, s), s * s * (3 - 2 * s), 1e-9);
    }
    assert_near(steepest, 1.25, 1e-4);
    torn_destroy(&knee);
}

static void keys_of_different_extents_blend_without_overshoot(void **state) {
    (void)state;
    struct random r = {9};
    struct torn knee;
    torn_start(&knee, torn_joint(&r));
    for (int i = 0; i < 3; i++) {
        struct joint_angles a = {.flexion_deg = (const double[]){15, 45, 65}[i],
                                 .varus_deg = -(const double[]){4, 6, 8}[i]},
                            b = a;
        b.varus_deg -= (const double[]){4, 8, 10}[i];
        torn_add(&knee, MCL, a, b);
    }
    torn_build(&knee, ADAPTIVE_HINGE);
    for (double f = 0; f < 120; f += 0.5)
        assert_true(torn_extra_valgus(&knee, f + 0.5, 20) >=
                    torn_extra_valgus(&knee, f, 20) - 1e-9);
    assert_near(torn_extra_valgus(&knee, 0, 4), 4, 1e-9);
    assert_near(torn_extra_valgus(&knee, 120, 8), 10, 1e-9);
    // half way between the first two, a cubic of slope 0 and m: their mean less m · 30 / 8
    double physical = 5 - (2.0 / 30 + 2.0 / 20) / 2 * 30 / 8;
    double extra = 6 - (4.0 / 30 + 2.0 / 20) / 2 * 30 / 8;
    assert_near(torn_extra_valgus(&knee, 30, physical / 2), extra / 2, 1e-9);
    torn_destroy(&knee);
}

// The medial side opens about the lateral contact, which stays where it is all the way.
static void a_target_that_turns_about_a_contact_turns_about_it_all_the_way(void **state) {
    (void)state;
    struct random r = {10};
    struct torn knee;
    torn_start(&knee, (struct joint_frame){SIDE_RIGHT, random_pose(&r, 40), random_pose(&r, 40)});
    vec3 contact = pose_apply(knee.setup.joint.T_tibia_joint, (vec3){25, -4, -3});
    vec3 axis = quat_rotate(knee.setup.joint.T_tibia_joint.rotation, (vec3){0, 1, 0});
    quat turn = quat_from_axis_angle(axis, -10 * RAD_PER_DEG);
    pose opened = {turn, vec3_sub(contact, quat_rotate(turn, contact))};
    for (int i = 0; i < 3; i++) {
        pose A =
            torn_pose(&knee, (struct joint_angles){.flexion_deg = 15 + 25 * i, .varus_deg = -6});
        knee.keys[knee.setup.key_count++] = (struct adaptive_key){MCL, A, pose_compose(A, opened)};
    }
    torn_build(&knee, ADAPTIVE_HINGE);
    for (int i = 0; i < 500; i++) {
        pose A = torn_pose(&knee, (struct joint_angles){.flexion_deg = random_between(&r, 0, 120),
                                                        .varus_deg = random_between(&r, -9, 0)});
        assert_vec3_near(pose_apply(torn_seen(&knee, A), contact), pose_apply(A, contact), 1e-9);
    }
    assert_near(torn_extra_valgus(&knee, 30, 6), 10, 1e-6);
    torn_destroy(&knee);
}

// ---- two ligaments ----

static void drawer_and_valgus_do_not_leak_into_each_other(void **state) {
    (void)state;
    struct random r = {11};
    struct torn valgus, drawer;
    torn_create(&valgus, &r, true, false);
    torn_create(&drawer, &r, false, true);
    for (int i = 0; i < 500; i++) {
        struct joint_angles a = {.flexion_deg = random_between(&r, 0, 120),
                                 .varus_deg = random_between(&r, -10, 0),
                                 .drawer_mm = random_between(&r, 0, 10)};
        assert_near(torn_extra(&valgus, a).varus_deg,
                    -torn_extra_valgus(&valgus, a.flexion_deg, -a.varus_deg), 1e-6);
        struct joint_angles alone = a;
        alone.varus_deg = 0;
        assert_near(torn_extra(&drawer, a).drawer_mm, torn_extra(&drawer, alone).drawer_mm, 1e-6);
        assert_near(torn_extra(&drawer, a).varus_deg, 0, 1e-6);
    }
    torn_destroy(&valgus);
    torn_destroy(&drawer);
}

static void two_torn_ligaments_open_at_once_and_each_by_itself(void **state) {
    (void)state;
    struct random r = {12};
    struct torn knee;
    torn_create(&knee, &r, true, true);
    for (double f = 0; f <= 120; f += 5) {
        struct joint_angles a = {.flexion_deg = f, .varus_deg = -6, .drawer_mm = 6};
        assert_near(torn_extra(&knee, a).varus_deg, -10, 1e-6);
        assert_near(torn_extra(&knee, a).drawer_mm, 5, 1e-6);
        a.drawer_mm = 0;
        assert_near(torn_extra(&knee, a).varus_deg, -10, 1e-6);
        assert_near(torn_extra(&knee, a).drawer_mm, 0, 1e-6);
        a = (struct joint_angles){.flexion_deg = f, .drawer_mm = 6};
        assert_near(torn_extra(&knee, a).varus_deg, 0, 1e-6);
        assert_near(torn_extra(&knee, a).drawer_mm, 5, 1e-6);
    }
    torn_destroy(&knee);
}

static void opposite_ligaments_open_each_to_its_side(void **state) {
    (void)state;
    struct random r = {15};
    struct torn knee;
    torn_start(&knee, torn_joint(&r));
    torn_add_valgus(&knee, 30, 10);
    torn_add_drawer(&knee, 40, 5);
    torn_add(&knee, LCL, (struct joint_angles){.flexion_deg = 50, .varus_deg = 4},
             (struct joint_angles){.flexion_deg = 50, .varus_deg = 11});
    torn_build(&knee, ADAPTIVE_HINGE);
    for (double f = 0; f <= 120; f += 5) {
        assert_near(torn_extra_valgus(&knee, f, 6), 10, 1e-6);
        assert_near(torn_extra_valgus(&knee, f, 3), 5, 1e-6);
        assert_near(torn_extra_valgus(&knee, f, -4), -7, 1e-6);
        assert_near(torn_extra_valgus(&knee, f, -2), -3.5, 1e-6);
    }
    torn_destroy(&knee);
}

// ---- smooth ----

static vec3 along_a_motion(const struct torn *knee, double t) {
    struct joint_angles a = {.flexion_deg = -10 + 140 * t,
                             .varus_deg = -9 * sin(23 * t),
                             .internal_deg = 5 * sin(7 * t),
                             .drawer_mm = 9 * sin(17 * t)};
    struct adaptive_warp warp;
    adaptive_at(knee->adaptive, ADAPTIVE_RAMP_STRAIGHT, torn_pose(knee, a), &warp);
    return pose_apply(warp.correction, (vec3){30, 20, 10});
}

// Largest change of the derivative over one step.
static double roughness(const struct torn *knee, int steps) {
    double most = 0, step = 1.0 / steps;
    for (int i = 1; i < steps; i++) {
        double t = i * step;
        vec3 before = along_a_motion(knee, t - step), after = along_a_motion(knee, t + step);
        vec3 mean = vec3_lerp(before, after, 0.5);
        most = fmax(most, 2 * vec3_distance(mean, along_a_motion(knee, t)) / step);
    }
    return most;
}

static void the_correction_has_no_kinks(void **state) {
    (void)state;
    struct random r = {13};
    struct torn knee;
    torn_start(&knee, torn_joint(&r));
    torn_add_rest_path(&knee, 7);
    for (int k = 0; k < 3; k++) {
        torn_add_recorded(&knee, &r, MCL, 15 + 25 * k);
        torn_add_recorded(&knee, &r, ACL, 20 + 30 * k);
    }
    torn_build(&knee, ADAPTIVE_HINGE);
    double coarse = roughness(&knee, 2000), fine = roughness(&knee, 16000);
    assert_true(coarse > 0.1);
    assert_true(fine < coarse / 4); // a kink stays as it is; a bend falls to an eighth
    torn_destroy(&knee);
}

// ---- frames ----

static void the_frames_of_the_bones_do_not_matter(void **state) {
    (void)state;
    struct random r = {14};
    for (int trial = 0; trial < 50; trial++) {
        struct random same = {(uint64_t)trial};
        struct torn near, far;
        pose femur = random_pose(&r, 1000), tibia = random_pose(&r, 1000);
        torn_start(&near, (struct joint_frame){SIDE_LEFT, pose_identity(), pose_identity()});
        torn_add_rest_path(&near, 5);
        for (int k = 0; k < 6; k++)
            torn_add_recorded(&near, &same, k % 2, 10 + 15 * k);
        far = near;
        far.setup.keys = far.keys;
        far.setup.rest = far.rest;
        far.setup.joint = (struct joint_frame){SIDE_LEFT, femur, tibia};
        for (int i = 0; i < far.setup.key_count; i++) {
            pose *A = &far.keys[i].T_femur_tibia, *target = &far.keys[i].target;
            *A = pose_compose(femur, pose_compose(*A, pose_inverse(tibia)));
            *target = pose_compose(femur, pose_compose(*target, pose_inverse(tibia)));
        }
        for (int i = 0; i < far.setup.rest_count; i++)
            far.rest[i] = pose_compose(femur, pose_compose(far.rest[i], pose_inverse(tibia)));
        torn_build(&near, ADAPTIVE_HINGE);
        torn_build(&far, ADAPTIVE_HINGE);
        struct joint_angles a = {.flexion_deg = random_between(&r, 0, 120),
                                 .varus_deg = random_between(&r, -9, 2),
                                 .drawer_mm = random_between(&r, -2, 9)};
        pose expected = pose_compose(
            femur, pose_compose(torn_seen(&near, torn_pose(&near, a)), pose_inverse(tibia)));
        assert_true(torn_apart(&far, torn_seen(&far, torn_pose(&far, a)), expected) < 1e-8);
        torn_destroy(&near);
        torn_destroy(&far);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_key_is_met_and_opens_nothing_else),
        cmocka_unit_test(keys_are_met_beside_a_rest_path_of_coupled_motions),
        cmocka_unit_test(nothing_opens_at_rest),
        cmocka_unit_test(nothing_opens_on_a_rest_path_through_keys),
        cmocka_unit_test(nothing_opens_the_other_way),
        cmocka_unit_test(an_opening_between_and_past_the_keys_is_theirs),
        cmocka_unit_test(half_of_an_opening_gives_half),
        cmocka_unit_test(more_opening_never_gives_less_nor_more_than_the_key),
        cmocka_unit_test(the_ramp_is_straight_but_at_its_ends_and_once_was_a_cubic),
        cmocka_unit_test(keys_of_different_extents_blend_without_overshoot),
        cmocka_unit_test(a_target_that_turns_about_a_contact_turns_about_it_all_the_way),
        cmocka_unit_test(drawer_and_valgus_do_not_leak_into_each_other),
        cmocka_unit_test(two_torn_ligaments_open_at_once_and_each_by_itself),
        cmocka_unit_test(opposite_ligaments_open_each_to_its_side),
        cmocka_unit_test(the_correction_has_no_kinks),
        cmocka_unit_test(the_frames_of_the_bones_do_not_matter),
    };
    return cmocka_run_group_tests_name("adaptive", tests, NULL, NULL);
}
