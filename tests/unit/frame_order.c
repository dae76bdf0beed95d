// Frames that come late, twice or never, against a model that remembers every number; and what a
// late one alone has told.
#include "runtime/frame_order.h"

#include "base/clock.h"
#include "random.h"
#include "runtime/late_frames.h"
#include "test.h"

#include <stdint.h>
#include <string.h>

#define NUMBERS 4000

// ---- numbers ------------------------------------------------------------------------------------

// Each number is sent once or twice, comes up to 60 numbers later, or never.
static void each_number_counts_once_as_newest_late_or_lost(void **state) {
    (void)state;
    static int at[2 * NUMBERS + 200][40], counts[2 * NUMBERS + 200];
    static bool came[NUMBERS + 1];
    struct random random = {3};
    struct frame_order order = {0};
    uint64_t lost = 0, more, newest = 0, late = 0, old = 0, expected_lost = 0, copies = 0;
    for (int number = 1; number <= NUMBERS; number++) {
        int copies_of_it = random_between(&random, 0, 1) < 0.2 ? 2 : 1;
        if (random_between(&random, 0, 1) < 0.1)
            continue;
        for (int i = 0; i < copies_of_it; i++, copies++) {
            int when = number + (int)random_between(&random, 0, 60);
            at[when][counts[when]++] = number;
        }
    }
    uint64_t highest = 0, first = 0;
    for (int when = 0; when < NUMBERS + 100; when++) {
        for (int i = 0; i < counts[when]; i++) {
            uint64_t number = (uint64_t)at[when][i];
            enum frame_place place = frame_order_note(&order, number, when * NS_PER_MS, &more);
            lost += more;
            first = first ? first : number;
            enum frame_place expected = number < first || came[number] ? FRAME_OLD
                                        : number > highest             ? FRAME_NEWEST
                                                                       : FRAME_LATE;
            assert_int_equal(place, expected);
            came[number] = true;
            highest = number > highest ? number : highest;
            newest += place == FRAME_NEWEST;
            late += place == FRAME_LATE;
            old += place == FRAME_OLD;
        }
        lost += frame_order_settle(&order, when * NS_PER_MS);
    }
    lost += frame_order_end(&order);
    for (uint64_t number = first; number <= highest; number++)
        expected_lost += !came[number];
    assert_int_equal(lost, expected_lost);
    assert_int_equal(newest + late + old, copies);
    assert_true(late > NUMBERS / 4);
}

static uint64_t note(struct frame_order *order, uint64_t number, enum frame_place expected) {
    uint64_t lost;
    assert_int_equal(frame_order_note(order, number, 0, &lost), expected);
    return lost;
}

static void a_number_far_ahead_is_wrong_and_loses_nothing(void **state) {
    (void)state;
    struct frame_order order = {0};
    assert_int_equal(note(&order, 1, FRAME_NEWEST), 0);
    assert_int_equal(note(&order, UINT64_MAX - 5, FRAME_WRONG), 0);
    assert_int_equal(note(&order, 0, FRAME_WRONG), 0);
    assert_int_equal(note(&order, 2, FRAME_NEWEST), 0);
    assert_int_equal(note(&order, 2 + FRAME_ORDER_JUMP_MAX + 1, FRAME_WRONG), 0);
    uint64_t lost = note(&order, 2 + FRAME_ORDER_JUMP_MAX, FRAME_NEWEST);
    assert_int_equal(lost + frame_order_end(&order), FRAME_ORDER_JUMP_MAX - 1);
    assert_int_equal(note(&order, UINT64_MAX - 1, FRAME_NEWEST), 0); // of another connection
    assert_int_equal(note(&order, UINT64_MAX, FRAME_NEWEST), 0);
    assert_int_equal(frame_order_end(&order), 0);
}

static void a_number_is_lost_when_it_has_not_come_for_so_long(void **state) {
    (void)state;
    struct frame_order order = {0};
    note(&order, 1, FRAME_NEWEST);
    note(&order, 3, FRAME_NEWEST);
    assert_int_equal(frame_order_settle(&order, FRAME_ORDER_PATIENCE_NS), 0); // marks 3
    assert_int_equal(frame_order_settle(&order, 2 * FRAME_ORDER_PATIENCE_NS - 1), 0);
    assert_int_equal(frame_order_settle(&order, 2 * FRAME_ORDER_PATIENCE_NS), 1);
    note(&order, 2, FRAME_OLD);
}

// ---- what late ones tell ------------------------------------------------------------------------

#define FRAME_NS (5 * NS_PER_MS)
#define HOLD_NS (100 * NS_PER_MS)

static struct frame frame_of(uint64_t number, double opening, uint32_t buttons) {
    struct frame frame = {.number = number, .time_ns = (int64_t)number * FRAME_NS, .count = 2};
    frame.samples[0] = (struct sample){.channel = CHANNEL_PUNCH,
                                       .kind = SAMPLE_POSE,
                                       .time_ns = frame.time_ns,
                                       .T_mockup_body = {quat_identity(), {(double)number, 0, 0}}};
    frame.samples[1] = (struct sample){.channel = CHANNEL_PUNCH,
                                       .kind = SAMPLE_HANDLE,
                                       .time_ns = frame.time_ns,
                                       .handle = {opening, buttons}};
    return frame;
}

static struct frame merged(struct late_frames *late, struct frame frame) {
    late_frames_merge(late, &frame, HOLD_NS);
    return frame;
}

static void keep(struct late_frames *late, struct frame frame) {
    late_frames_keep(late, &frame);
}

static void a_press_that_only_a_late_frame_told_is_taken_along_once(void **state) {
    (void)state;
    struct late_frames late = {0};
    merged(&late, frame_of(1, 0.5, 1));
    merged(&late, frame_of(4, 0.5, 1));
    keep(&late, frame_of(3, 0.5, 3));
    keep(&late, frame_of(2, 0.5, 3)); // of the same press
    struct frame next = merged(&late, frame_of(5, 0.5, 1));
    assert_int_equal(next.samples[1].handle.buttons, 3);
    assert_true(next.samples[0].T_mockup_body.translation.x == 5); // poses never go back
    next = merged(&late, frame_of(6, 0.5, 1));
    assert_int_equal(next.samples[1].handle.buttons, 1);
}

static void a_release_and_a_bite_are_taken_along(void **state) {
    (void)state;
    struct late_frames late = {0};
    merged(&late, frame_of(1, 0.8, 1));
    merged(&late, frame_of(3, 0.9, 1));
    keep(&late, frame_of(2, 0.1, 0));
    struct frame next = merged(&late, frame_of(4, 1, 1));
    assert_int_equal(next.samples[1].handle.buttons, 0);
    assert_true(next.samples[1].handle.opening == 0.1);
    next = merged(&late, frame_of(5, 1, 1));
    assert_true(next.samples[1].handle.opening == 1);
}

static void what_newer_frames_told_too_changes_nothing(void **state) {
    (void)state;
    struct late_frames late = {0};
    merged(&late, frame_of(1, 0.2, 0));
    merged(&late, frame_of(3, 0.6, 1));
    keep(&late, frame_of(2, 0.4, 1));
    struct frame frame = frame_of(4, 0.7, 1);
    struct frame next = merged(&late, frame);
    assert_memory_equal(&next, &frame, sizeof next);
}

static void a_press_that_is_no_longer_valid_is_not_taken(void **state) {
    (void)state;
    struct late_frames late = {0};
    merged(&late, frame_of(1, 0.5, 0));
    merged(&late, frame_of(3, 0.5, 0));
    keep(&late, frame_of(2, 0.5, 1));
    struct frame next = merged(&late, frame_of(3 + HOLD_NS / FRAME_NS, 0.5, 0));
    assert_int_equal(next.samples[1].handle.buttons, 0);
}

// A station may name a channel only in the frame after it was measured.
static void a_sample_newer_than_any_taken_is_added(void **state) {
    (void)state;
    struct late_frames late = {0};
    struct frame with_joint = frame_of(2, 0.5, 0);
    with_joint.samples[with_joint.count++] = (struct sample){.channel = CHANNEL_JOINT,
                                                             .kind = SAMPLE_JOINT,
                                                             .time_ns = with_joint.time_ns,
                                                             .joint = {.flexion_deg = 33}};
    merged(&late, frame_of(1, 0.5, 0));
    merged(&late, frame_of(3, 0.5, 0));
    keep(&late, with_joint);
    struct frame next = merged(&late, frame_of(4, 0.5, 0));
    assert_int_equal(next.count, 3);
    assert_true(next.samples[2].joint.flexion_deg == 33);
    next = merged(&late, frame_of(5, 0.5, 0));
    assert_int_equal(next.count, 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_number_counts_once_as_newest_late_or_lost),
        cmocka_unit_test(a_number_far_ahead_is_wrong_and_loses_nothing),
        cmocka_unit_test(a_number_is_lost_when_it_has_not_come_for_so_long),
        cmocka_unit_test(a_press_that_only_a_late_frame_told_is_taken_along_once),
        cmocka_unit_test(a_release_and_a_bite_are_taken_along),
        cmocka_unit_test(what_newer_frames_told_too_changes_nothing),
        cmocka_unit_test(a_press_that_is_no_longer_valid_is_not_taken),
        cmocka_unit_test(a_sample_newer_than_any_taken_is_added),
    };
    return cmocka_run_group_tests_name("frame_order", tests, NULL, NULL);
}
