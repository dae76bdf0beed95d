// What is made of the samples of one channel: jumps, silence, values that cannot be. No clock.

#include "samples/slot.h"

#include "base/clock.h"
#include "random.h"
#include "samples/guard.h"
#include "test.h"

static pose at(double x) {
    return (pose){{1, 0, 0, 0}, {x, 0, 0}};
}

static struct sample probe(int64_t ms, double x) {
    return (struct sample){.channel = CHANNEL_PROBE,
                           .kind = SAMPLE_POSE,
                           .time_ns = ms * NS_PER_MS,
                           .T_mockup_body = at(x)};
}

static struct slot probe_slot(double hold_ms) {
    struct slot slot;
    slot_init(&slot, CHANNEL_PROBE, SAMPLE_POSE, 3, hold_ms, SLOT_JUMP_MM);
    return slot;
}

static enum validity validity_at(struct slot *slot, int64_t ms) {
    slot_age(slot, ms * NS_PER_MS);
    return slot->validity;
}

// ---- the guard ----------------------------------------------------------------------------------

static void one_wild_pose_is_caught_and_the_next_good_one_taken(void **state) {
    (void)state;
    struct guard guard;
    guard_init(&guard, &guard_hand, 15, 15);
    for (int i = 1; i <= 100; i++) {
        bool wild = i % 10 == 0;
        assert_int_equal(!wild, guard_takes(&guard, i * 20 * NS_PER_MS, at(wild ? 1562 : i)));
    }
}

static void a_body_that_was_moved_is_taken_after_a_while(void **state) {
    (void)state;
    struct guard guard;
    guard_init(&guard, &guard_hand, 15, 15);
    int64_t ms = 0;
    for (int i = 0; i < 10; i++)
        assert_true(guard_takes(&guard, (ms += 10) * NS_PER_MS, at(0)));
    for (int i = 0; i < GUARD_CONFIRMATION_NS / (10 * NS_PER_MS); i++)
        assert_false(guard_takes(&guard, (ms += 10) * NS_PER_MS, at(400 + i)));
    for (int i = 0; i < 10; i++)
        assert_true(guard_takes(&guard, (ms += 10) * NS_PER_MS, at(520 + i)));
    assert_false(guard_takes(&guard, (ms += 10) * NS_PER_MS, at(0)));
}

static void wild_poses_that_do_not_lie_together_are_never_taken(void **state) {
    (void)state;
    struct guard guard;
    struct random random = {1};
    guard_init(&guard, &guard_hand, 15, 15);
    assert_true(guard_takes(&guard, NS_PER_MS, at(0)));
    for (int i = 2; i < 500; i++) {
        pose p = {{1, 0, 0, 0}, vec3_scale(500 + 200 * (i % 7), random_direction(&random))};
        p.translation.z = 300 * (i % 3 - 1) + 2000;
        assert_false(guard_takes(&guard, i * NS_PER_MS, p));
    }
}

static void a_fast_hand_at_a_slow_rate_is_no_jump(void **state) {
    (void)state;
    struct guard guard;
    guard_init(&guard, &guard_hand, 15, 15);
    double x = 0, speed = 0; // accelerates by 40 mm a frame, to 3 m/s at 15 frames a second
    assert_true(guard_takes(&guard, NS_PER_MS, at(x)));
    for (int i = 0; i < 40; i++) {
        speed = fmin(200, speed + 40);
        x += speed;
        assert_true(guard_takes(&guard, (i + 1) * 66 * NS_PER_MS, at(x)));
    }
}

static void a_turn_that_no_hand_makes_is_caught(void **state) {
    (void)state;
    struct guard guard;
    guard_init(&guard, &guard_hand, 15, 15);
    for (int i = 1; i <= 50; i++) {
        pose p = at(i);
        if (i % 10 == 0)
            p.rotation = quat_from_axis_angle((vec3){0, 1, 0}, 100 * RAD_PER_DEG);
        assert_int_equal(i % 10 != 0, guard_takes(&guard, i * 10 * NS_PER_MS, p));
    }
}

static void
a_jump_that_lasts_too_short_to_be_true_is_never_taken_though_the_channel_is_lost(void **state) {
    (void)state;
    struct slot slot = probe_slot(100);
    for (int64_t ms = 1000; ms < 4000; ms += 10) {
        bool away = ms >= 2000 && ms < 3000;
        struct sample s = probe(ms, away ? 300 : 0);
        slot_age(&slot, ms * NS_PER_MS);
        assert_int_equal(away ? SLOT_JUMP : SLOT_USED, slot_take(&slot, &s, s.time_ns));
        if (ms > 2150 && away)
            assert_int_equal(VALIDITY_LOST, validity_at(&slot, ms));
    }
}

// ---- the slot -----------------------------------------------------------------------------------

static void a_silent_channel_is_held_then_lost_then_back(void **state) {
    (void)state;
    struct slot slot = probe_slot(100);
    assert_int_equal(VALIDITY_LOST, validity_at(&slot, 1000));
    for (int64_t ms = 1000; ms <= 2000; ms += 10) {
        struct sample s = probe(ms, 1);
        assert_int_equal(SLOT_USED, slot_take(&slot, &s, s.time_ns));
        assert_int_equal(VALIDITY_OK, validity_at(&slot, ms + 9));
    }
    assert_int_equal(VALIDITY_OK, validity_at(&slot, 2019));
    assert_int_equal(VALIDITY_HELD, validity_at(&slot, 2020));
    assert_int_equal(VALIDITY_HELD, validity_at(&slot, 2119));
    assert_true(slot_age(&slot, 2120 * NS_PER_MS));
    assert_int_equal(VALIDITY_LOST, validity_at(&slot, 2121));
    assert_false(slot_age(&slot, 2130 * NS_PER_MS));
    assert_true(slot.newest.time_ns == 2000 * NS_PER_MS);
    struct sample back = probe(3000, 900);
    assert_int_equal(SLOT_USED, slot_take(&slot, &back, back.time_ns));
    assert_int_equal(VALIDITY_OK, validity_at(&slot, 3001));
    assert_int_equal(3, slot.newest.device);
}

static void a_sample_that_its_source_calls_lost_is_held_first(void **state) {
    (void)state;
    struct slot slot = probe_slot(100);
    for (int64_t ms = 1000; ms <= 1100; ms += 10) {
        struct sample s = probe(ms, 1);
        slot_take(&slot, &s, s.time_ns);
    }
    struct sample lost = probe(1110, 5000);
    lost.validity = VALIDITY_LOST;
    assert_int_equal(SLOT_SILENT, slot_take(&slot, &lost, lost.time_ns));
    assert_int_equal(VALIDITY_HELD, validity_at(&slot, 1110));
    assert_near(slot.newest.T_mockup_body.translation.x, 1, 0);
    struct sample good = probe(1120, 2);
    assert_int_equal(SLOT_USED, slot_take(&slot, &good, good.time_ns));
    assert_int_equal(VALIDITY_OK, validity_at(&slot, 1121));
    for (int64_t ms = 1130; ms < 1230; ms += 10) {
        lost.time_ns = ms * NS_PER_MS;
        slot_take(&slot, &lost, lost.time_ns);
        assert_int_equal(VALIDITY_HELD, validity_at(&slot, ms));
    }
    assert_int_equal(VALIDITY_LOST, validity_at(&slot, 1230));
}

static void values_that_no_frame_may_have_are_malformed(void **state) {
    (void)state;
    struct slot slot = probe_slot(100);
    struct sample good = probe(1000, 1), bad = probe(1010, 1);
    assert_int_equal(SLOT_USED, slot_take(&slot, &good, good.time_ns));
    bad.T_mockup_body.translation.y = NAN;
    assert_int_equal(SLOT_MALFORMED, slot_take(&slot, &bad, bad.time_ns));
    bad = probe(1010, 20000);
    assert_int_equal(SLOT_MALFORMED, slot_take(&slot, &bad, bad.time_ns));
    bad = probe(1010, 1);
    bad.T_mockup_body.rotation.w = 0.5;
    assert_int_equal(SLOT_MALFORMED, slot_take(&slot, &bad, bad.time_ns));
    bad = probe(1000, 1);
    assert_int_equal(SLOT_MALFORMED, slot_take(&slot, &bad, bad.time_ns));
    bad = probe(900, 1);
    assert_int_equal(SLOT_MALFORMED, slot_take(&slot, &bad, bad.time_ns));
    assert_near(slot.newest.T_mockup_body.translation.x, 1, 0);
    assert_int_equal(VALIDITY_HELD, validity_at(&slot, 1010));
}

static void a_slow_source_is_not_called_silent_between_its_samples(void **state) {
    (void)state;
    struct slot slot = probe_slot(100);
    for (int64_t ms = 1000; ms <= 4000; ms += 66) {
        struct sample s = probe(ms, 1);
        assert_int_equal(SLOT_USED, slot_take(&slot, &s, s.time_ns));
        assert_int_equal(VALIDITY_OK, validity_at(&slot, ms + 65));
    }
}

static void values_go_on_when_the_clock_goes_back(void **state) {
    (void)state;
    struct slot slot = probe_slot(100);
    for (int64_t ms = 5000; ms <= 5500; ms += 10) {
        struct sample s = probe(ms, 1);
        assert_int_equal(SLOT_USED, slot_take(&slot, &s, s.time_ns));
    }
    for (int64_t ms = 3500; ms <= 4000; ms += 10) {
        struct sample s = probe(ms, 2);
        slot_age(&slot, ms * NS_PER_MS);
        assert_int_equal(SLOT_USED, slot_take(&slot, &s, s.time_ns));
        assert_int_equal(VALIDITY_OK, slot.validity);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_wild_pose_is_caught_and_the_next_good_one_taken),
        cmocka_unit_test(a_body_that_was_moved_is_taken_after_a_while),
        cmocka_unit_test(wild_poses_that_do_not_lie_together_are_never_taken),
        cmocka_unit_test(a_fast_hand_at_a_slow_rate_is_no_jump),
        cmocka_unit_test(a_turn_that_no_hand_makes_is_caught),
        cmocka_unit_test(
            a_jump_that_lasts_too_short_to_be_true_is_never_taken_though_the_channel_is_lost),
        cmocka_unit_test(a_silent_channel_is_held_then_lost_then_back),
        cmocka_unit_test(a_sample_that_its_source_calls_lost_is_held_first),
        cmocka_unit_test(values_that_no_frame_may_have_are_malformed),
        cmocka_unit_test(a_slow_source_is_not_called_silent_between_its_samples),
        cmocka_unit_test(values_go_on_when_the_clock_goes_back),
    };
    return cmocka_run_group_tests_name("slot", tests, NULL, NULL);
}
