#include "scene/torn.h"
#include "test.h"

#include <string.h>

static void kinds_have_names(void **state) {
    (void)state;
    enum adaptive_kind kind;
    for (int i = 0; i < ADAPTIVE_COUNT; i++) {
        assert_true(adaptive_from_name(adaptive_name((enum adaptive_kind)i), &kind));
        assert_int_equal(kind, i);
    }
    assert_false(adaptive_from_name("Hinge", &kind));
}

static void without_keys_nothing_is_corrected(void **state) {
    (void)state;
    struct random r = {1};
    for (int kind = 0; kind < ADAPTIVE_COUNT; kind++) {
        struct torn knee;
        torn_start(&knee, torn_joint(&r));
        torn_build(&knee, (enum adaptive_kind)kind);
        pose A = torn_pose(&knee, (struct joint_angles){30, -9, 5, 1, 7, 2});
        assert_true(torn_apart(&knee, torn_seen(&knee, A), A) < 1e-9);
        assert_int_equal(adaptive_check(knee.adaptive, NULL), RESULT_OK);
        torn_destroy(&knee);
    }
}

// ---- what is refused ----

static void with_ligament_out_of_range(struct torn *knee) {
    knee->keys[2].ligament = ADAPTIVE_LIGAMENTS_MAX;
}

static void with_negative_ligament(struct torn *knee) {
    knee->keys[1].ligament = -1;
}

static void with_broken_pose(struct torn *knee) {
    knee->keys[1].T_femur_tibia.translation.x = NAN;
}

static void with_broken_target(struct torn *knee) {
    knee->keys[1].target.rotation.w = 3;
}

static void with_broken_rest(struct torn *knee) {
    knee->rest[knee->setup.rest_count++] = (pose){{1, 0, 0, 0}, {0, INFINITY, 0}};
}

static void with_rest_twice(struct torn *knee) {
    torn_add_rest_path(knee, 2);
    knee->rest[knee->setup.rest_count++] = knee->rest[1];
}

static void with_keys_too_close(struct torn *knee) {
    torn_add_valgus(knee, 45.5, 8);
}

static void with_a_key_at_rest(struct torn *knee) {
    torn_add(knee, ACL, (struct joint_angles){.flexion_deg = 30},
             (struct joint_angles){.flexion_deg = 30, .drawer_mm = 5});
}

static void with_a_wild_target(struct torn *knee) {
    torn_add(knee, ACL, (struct joint_angles){.flexion_deg = 30, .drawer_mm = 5},
             (struct joint_angles){.flexion_deg = 125});
}

static void with_a_ligament_that_opens_like_another(struct torn *knee) {
    torn_add(knee, PLC, (struct joint_angles){.flexion_deg = 30, .varus_deg = -8},
             (struct joint_angles){.flexion_deg = 30, .varus_deg = -15});
}

static void with_a_ligament_between_two_others(struct torn *knee) {
    torn_add_drawer(knee, 30, 5);
    torn_add(knee, PLC, (struct joint_angles){.flexion_deg = 30, .varus_deg = -6, .drawer_mm = 6},
             (struct joint_angles){.flexion_deg = 30, .varus_deg = -9, .drawer_mm = 9});
}

static void with_a_ligament_that_turns_over(struct torn *knee) {
    torn_add(knee, MCL, (struct joint_angles){.flexion_deg = 90, .varus_deg = 6},
             (struct joint_angles){.flexion_deg = 90, .varus_deg = 12});
}

static void with_too_many_keys(struct torn *knee) {
    knee->setup.key_count = ADAPTIVE_KEYS_MAX + 1;
}

static void with_too_long_a_rest_path(struct torn *knee) {
    knee->setup.rest_count = ADAPTIVE_KEYS_MAX + 1;
}

static const struct {
    const char *name;
    void (*spoil)(struct torn *knee);
    enum result result;
    const char *says;
} refused[] = {
    {"ligament out of range", with_ligament_out_of_range, RESULT_INVALID, "key 2: no ligament 8"},
    {"negative ligament", with_negative_ligament, RESULT_INVALID, "key 1: no ligament -1"},
    {"broken pose", with_broken_pose, RESULT_INVALID, "key 1: not a pose"},
    {"broken target", with_broken_target, RESULT_INVALID, "key 1: not a pose"},
    {"broken rest", with_broken_rest, RESULT_INVALID, "rest key 0: not a pose"},
    {"rest twice", with_rest_twice, RESULT_INVALID, "rest key 2: within 1 degrees"},
    {"keys too close", with_keys_too_close, RESULT_INVALID, "key 3: within 1 degrees"},
    {"key at rest", with_a_key_at_rest, RESULT_INVALID, "ligament 1: does not leave the rest path"},
    {"wild target", with_a_wild_target, RESULT_INVALID, "key 3: a correction of more than 90"},
    {"like another", with_a_ligament_that_opens_like_another, RESULT_INVALID,
     "ligament 0: opens as others do"},
    {"between two others", with_a_ligament_between_two_others, RESULT_INVALID,
     "ligament 3: opens as others do"},
    {"turns over", with_a_ligament_that_turns_over, RESULT_INVALID,
     "ligament 0: does not leave the rest path"},
    {"too many", with_too_many_keys, RESULT_LIMIT, "more than 32 keys"},
    {"too long", with_too_long_a_rest_path, RESULT_LIMIT, "more than 32 keys"},
};

static void keys_that_contradict_are_refused_by_name(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
        struct random r = {i};
        struct torn knee;
        torn_start(&knee, torn_joint(&r));
        for (int k = 0; k < 3; k++)
            torn_add_valgus(&knee, 15 + 30 * k, 10);
        refused[i].spoil(&knee);
        struct error error = {""};
        enum result result = adaptive_create(&knee.setup, &knee.adaptive, &error);
        if (result != refused[i].result || !strstr(error.text, refused[i].says))
            fail_msg("%s: %d, %s", refused[i].name, (int)result, error.text);
        assert_null(knee.adaptive);
    }
}

static void stretch(pose *p) {
    quat *q = &p->rotation;
    *q = (quat){1.0005 * q->w, 1.0005 * q->x, 1.0005 * q->y, 1.0005 * q->z};
}

static void rotations_need_not_be_quite_of_unit_length(void **state) {
    (void)state;
    struct random r = {5};
    struct torn knee;
    torn_create(&knee, &r, true, true);
    pose A = torn_pose(&knee, (struct joint_angles){.flexion_deg = 40, .varus_deg = -4});
    struct adaptive_warp exact, warp;
    adaptive_at(knee.adaptive, ADAPTIVE_RAMP_STRAIGHT, A, &exact);
    torn_destroy(&knee);
    for (int i = 0; i < knee.setup.key_count; i++) {
        stretch(&knee.keys[i].T_femur_tibia);
        stretch(&knee.keys[i].target);
    }
    stretch(&knee.setup.joint.T_femur_joint);
    stretch(&knee.setup.joint.T_tibia_joint);
    stretch(&A);
    torn_build(&knee, ADAPTIVE_HINGE);
    adaptive_at(knee.adaptive, ADAPTIVE_RAMP_STRAIGHT, A, &warp);
    assert_true(torn_apart(&knee, warp.correction, exact.correction) < 1e-9);
    torn_destroy(&knee);
}

static void a_missed_key_is_named(void **state) {
    (void)state;
    struct random r = {3};
    struct torn knee;
    torn_create(&knee, &r, true, false);
    assert_int_equal(adaptive_check(knee.adaptive, NULL), RESULT_OK);
    torn_destroy(&knee);
    torn_build(&knee, ADAPTIVE_PAPER); // where keys add up
    struct error error = {""};
    assert_int_equal(adaptive_check(knee.adaptive, &error), RESULT_INVALID);
    assert_non_null(strstr(error.text, "key 0 (ligament 0, flexion 15.0 degrees)"));
    torn_destroy(&knee);
}

// ---- Eq. 7, for comparison ----

static void torn_in_the_paper(struct torn *knee, enum adaptive_kind kind, int keys) {
    struct random r = {4};
    torn_start(knee, torn_joint(&r));
    for (int i = 0; i < keys; i++)
        torn_add_valgus(knee, (const double[]){45, 15, 65}[i], 10);
    torn_build(knee, kind);
}

static void eq_7_as_printed_warps_at_rest_and_adds_up(void **state) {
    (void)state;
    struct torn knee;
    torn_in_the_paper(&knee, ADAPTIVE_PAPER, 1);
    struct adaptive_warp warp;
    adaptive_at(knee.adaptive, ADAPTIVE_RAMP_STRAIGHT, torn_pose(&knee, (struct joint_angles){0}),
                &warp);
    assert_near(warp.opening[MCL], exp(-0.5), 1e-12); // 0.61
    assert_near(warp.share[MCL], warp.opening[MCL], 0);
    assert_near(torn_extra_valgus(&knee, 0, 0), 10 * exp(-0.5), 1e-6);
    assert_near(torn_extra_valgus(&knee, 45, 6), 10, 1e-6);
    torn_destroy(&knee);

    torn_in_the_paper(&knee, ADAPTIVE_PAPER, 3);
    double most = 0;
    for (double f = 15; f <= 65; f += 0.25)
        most = fmax(most, torn_extra_valgus(&knee, f, 6));
    assert_near(most, 26, 0.05);
    torn_destroy(&knee);
}

// The curves of Fig. 10: maximal valgus over flexion.
static void eq_7_narrowed_has_a_spike_for_one_key_and_dips_between_three(void **state) {
    (void)state;
    struct torn knee;
    torn_in_the_paper(&knee, ADAPTIVE_PAPER_NARROW, 0);
    assert_near(torn_extra_valgus(&knee, 45, 6), 0, 1e-9);
    torn_destroy(&knee);

    torn_in_the_paper(&knee, ADAPTIVE_PAPER_NARROW, 1);
    assert_near(torn_extra_valgus(&knee, 45, 6), 10, 1e-6);
    assert_true(torn_extra_valgus(&knee, 20, 6) < 0.01 && torn_extra_valgus(&knee, 70, 6) < 0.01);
    torn_destroy(&knee);

    torn_in_the_paper(&knee, ADAPTIVE_PAPER_NARROW, 3);
    assert_near(torn_extra_valgus(&knee, 30, 6), 0.9, 0.05);
    assert_near(torn_extra_valgus(&knee, 55, 6), 5.0, 0.05);
    torn_destroy(&knee);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kinds_have_names),
        cmocka_unit_test(without_keys_nothing_is_corrected),
        cmocka_unit_test(keys_that_contradict_are_refused_by_name),
        cmocka_unit_test(rotations_need_not_be_quite_of_unit_length),
        cmocka_unit_test(a_missed_key_is_named),
        cmocka_unit_test(eq_7_as_printed_warps_at_rest_and_adds_up),
        cmocka_unit_test(eq_7_narrowed_has_a_spike_for_one_key_and_dips_between_three),
    };
    return cmocka_run_group_tests_name("adaptive_keys", tests, NULL, NULL);
}
