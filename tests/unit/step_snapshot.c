// What a page is shown of a step, and how devices are counted.
#include "runtime/step_snapshot.h"

#include "base/clock.h"
#include "runtime/devices.h"
#include "test.h"

#include <math.h>
#include <string.h>

#define START_NS (5 * NS_PER_S)
#define PROBE 0

static struct session_output step_at(int64_t time_ns, vec3 tip) {
    static uint64_t number;
    struct session_output output = {.step = ++number, .time_ns = time_ns};
    for (int i = 0; i < BODY_COUNT; i++)
        output.T_mockup_body[i] = output.T_mockup_virtual[i] = pose_identity();
    output.instruments[PROBE] = (struct instrument_output){
        .present = true,
        .T_mockup_tip = {quat_identity(), tip},
        .T_mockup_warped = {quat_identity(), vec3_add(tip, (vec3){0, 3, 4})},
        .warp = {.displacement = {0, 3, 4}, .nearest_mm = INFINITY},
        .discrepancy = {.gain = 1.5, .gain_least = 0.5},
        .handle = {0.25, 2},
    };
    return output;
}

// ---- moments ------------------------------------------------------------------------------------

static void an_instrument_that_is_lost_stands_where_it_was_seen(void **state) {
    (void)state;
    struct snapshot_maker moments;
    arthron_Moment message;
    snapshot_begin(&moments, 7, START_NS);
    struct session_output output = step_at(START_NS + NS_PER_S, (vec3){1, 2, 3});
    snapshot_step(&moments, &output);
    output = step_at(START_NS + 2 * NS_PER_S, (vec3){0, 0, 0});
    memset(&output.instruments[PROBE], 0, sizeof output.instruments[PROBE]);
    snapshot_step(&moments, &output);
    snapshot_to_wire(&moments.now, 3, &message);
    assert_int_equal(moments.now.session, 7);
    assert_int_equal(message.station_number, 3);
    assert_int_equal(message.time_ns, 2 * NS_PER_S);
    assert_int_equal(message.instruments_count, 1);
    assert_int_equal(message.instruments[0].channel, CHANNEL_PROBE);
    assert_int_equal(message.instruments[0].validity, arthron_Validity_LOST);
    assert_float_equal(message.instruments[0].tip.t[2], 3, 0);
    assert_float_equal(message.instruments[0].warped.t[1], 5, 0);
}

static void a_session_that_is_closed_shows_its_instruments_as_they_were(void **state) {
    (void)state;
    struct snapshot_maker moments;
    arthron_Moment message;
    snapshot_begin(&moments, 7, START_NS);
    struct session_output output = step_at(START_NS + NS_PER_S, (vec3){1, 2, 3});
    output.instruments[PROBE].validity = VALIDITY_HELD;
    snapshot_step(&moments, &output);
    output = step_at(START_NS + 2 * NS_PER_S, (vec3){0, 0, 0});
    output.state = SESSION_CLOSED;
    memset(&output.instruments[PROBE], 0, sizeof output.instruments[PROBE]);
    snapshot_step(&moments, &output);
    snapshot_to_wire(&moments.now, 3, &message);
    const arthron_InstrumentMoment *probe = &message.instruments[0];
    assert_int_equal(probe->validity, arthron_Validity_HELD);
    assert_float_equal(probe->warped.t[1], 5, 0);
    assert_float_equal(probe->warp_mm, 5, 1e-6);
    assert_float_equal(probe->speed_mm_s, 0, 0);
    assert_int_equal(probe->buttons, 0);
}

static void a_moment_tells_what_the_step_had(void **state) {
    (void)state;
    struct snapshot_maker moments;
    arthron_Moment message;
    snapshot_begin(&moments, 1, START_NS);
    struct session_output output = step_at(START_NS, (vec3){1, 2, 3});
    output.T_mockup_virtual[BODY_TIBIA].translation.x = 2;
    output.instruments[PROBE].warp.nearest_mm = 0.5;
    snapshot_step(&moments, &output);
    snapshot_to_wire(&moments.now, 0, &message);
    const arthron_InstrumentMoment *probe = &message.instruments[0];
    assert_float_equal(probe->warp_mm, 5, 1e-6);
    assert_float_equal(probe->nearest_mm, 0.5, 0);
    assert_float_equal(probe->gain, 1.5, 0);
    assert_float_equal(probe->gain_least, 0.5, 0);
    assert_float_equal(probe->opening, 0.25, 0);
    assert_int_equal(probe->buttons, 2);
    assert_int_equal(message.bodies_count, BODY_COUNT);
    assert_false(message.bodies[BODY_FEMUR].has_virtual_pose);
    assert_true(message.bodies[BODY_TIBIA].has_virtual_pose);
    assert_float_equal(message.bodies[BODY_TIBIA].virtual_pose.t[0], 2, 0);
}

static void a_moment_tells_the_force_while_it_is_known(void **state) {
    (void)state;
    static struct snapshot_maker moments;
    static struct metrics metrics;
    static const struct {
        int64_t ms;
        enum validity validity;
        bool has_force, tells;
    } rows[] = {{0, VALIDITY_OK, false, false},   {10, VALIDITY_OK, true, true},
                {100, VALIDITY_OK, false, true},  {111, VALIDITY_OK, false, false},
                {120, VALIDITY_HELD, true, true}, {130, VALIDITY_LOST, true, false}};
    snapshot_begin(&moments, 1, START_NS);
    metrics_init(&metrics, instruments_usual(), view_optic_usual());
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct session_output output = step_at(START_NS + rows[i].ms * NS_PER_MS, (vec3){0, 0, 0});
        struct session_input input = {.kind = INPUT_FRAME, .frame.count = rows[i].has_force};
        input.frame.samples[0] = (struct sample){.channel = CHANNEL_PROBE,
                                                 .kind = SAMPLE_FORCE,
                                                 .validity = rows[i].validity,
                                                 .force_n = -2.5};
        arthron_Moment message;
        metrics_step(&metrics, &input, &output);
        snapshot_step(&moments, &output);
        snapshot_forces(&moments, &metrics);
        snapshot_to_wire(&moments.now, 0, &message);
        assert_int_equal(message.instruments[0].has_force_n, rows[i].tells);
        assert_float_equal(message.instruments[0].force_n, rows[i].tells ? -2.5 : 0, 0);
    }
}

static void events_are_counted(void **state) {
    (void)state;
    struct snapshot_maker moments;
    snapshot_begin(&moments, 1, START_NS);
    for (int i = 0; i < 6; i++) {
        struct session_output output = step_at(START_NS + i, (vec3){0, 0, 0});
        output.events = i % 2 ? EVENT_CONTACT | EVENT_CUT : EVENT_CONTACT;
        snapshot_step(&moments, &output);
    }
    assert_int_equal(moments.now.events[3], 6);
    assert_int_equal(moments.now.events[5], 3);
    assert_int_equal(moments.now.events[4], 0);
}

// At 100 mm/s, seen at each 10th step only, with a tracker's noise on it.
static void speed_is_that_of_the_hand_and_not_of_noise(void **state) {
    (void)state;
    struct snapshot_maker moments;
    snapshot_begin(&moments, 1, START_NS);
    double least = INFINITY, most = 0;
    vec3 tip = {0, 0, 0};
    for (int i = 0; i < 2000; i++) {
        if (i % 10 == 0)
            tip = (vec3){0.1 * i, i % 20 ? 0.1 : -0.1, 0};
        struct session_output output = step_at(START_NS + i * NS_PER_MS, tip);
        snapshot_step(&moments, &output);
        double speed = moments.now.instruments[PROBE].speed_mm_s;
        least = i > 500 ? fmin(least, speed) : least;
        most = i > 500 ? fmax(most, speed) : most;
    }
    assert_true(least > 85 && most < 115);
}

static void an_instrument_that_reappears_elsewhere_was_not_fast(void **state) {
    (void)state;
    struct snapshot_maker moments;
    snapshot_begin(&moments, 1, START_NS);
    struct session_output output = step_at(START_NS, (vec3){0, 0, 0});
    snapshot_step(&moments, &output);
    struct session_output away = step_at(START_NS + NS_PER_MS, (vec3){0, 0, 0});
    away.instruments[PROBE].present = false;
    snapshot_step(&moments, &away);
    output = step_at(START_NS + 2 * NS_PER_MS, (vec3){200, 0, 0});
    snapshot_step(&moments, &output);
    assert_float_equal(moments.now.instruments[PROBE].speed_mm_s, 0, 0);
}

// ---- devices ------------------------------------------------------------------------------------

static struct frame frame_of(int64_t encoders_ns, int64_t probe_ns, enum validity probe) {
    return (struct frame){
        .count = 2,
        .samples = {
            {.channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT, .device = 0, .time_ns = encoders_ns},
            {.channel = CHANNEL_PROBE,
             .kind = SAMPLE_POSE,
             .device = 1,
             .validity = probe,
             .time_ns = probe_ns},
        }};
}

static void devices_are_counted_by_what_they_measured(void **state) {
    (void)state;
    static struct device_counts counts[WIRE_DEVICES_MAX];
    struct device_watch watch;
    devices_begin(&watch, counts);
    for (int i = 1; i <= 100; i++) { // the tracker is silent in each fourth frame
        bool silent = i % 4 == 0;
        struct frame frame = frame_of(i, silent ? i - 1 : i, silent ? VALIDITY_HELD : VALIDITY_OK);
        devices_step(&watch, &frame, counts);
    }
    assert_int_equal(atomic_load(&counts[0].samples), 100);
    assert_int_equal(atomic_load(&counts[1].samples), 75);
    assert_int_equal(atomic_load(&counts[0].dropouts), 0);
    assert_int_equal(atomic_load(&counts[1].dropouts), 25);
    assert_false(atomic_load(&counts[1].lost));
    struct frame lost = frame_of(101, 99, VALIDITY_LOST);
    devices_step(&watch, &lost, counts);
    assert_true(atomic_load(&counts[1].lost));
    assert_false(atomic_load(&counts[0].lost));
    devices_begin(&watch, counts);
    assert_int_equal(atomic_load(&counts[1].dropouts), 0);
    assert_false(atomic_load(&counts[1].lost));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_instrument_that_is_lost_stands_where_it_was_seen),
        cmocka_unit_test(a_session_that_is_closed_shows_its_instruments_as_they_were),
        cmocka_unit_test(a_moment_tells_what_the_step_had),
        cmocka_unit_test(a_moment_tells_the_force_while_it_is_known),
        cmocka_unit_test(events_are_counted),
        cmocka_unit_test(speed_is_that_of_the_hand_and_not_of_noise),
        cmocka_unit_test(an_instrument_that_reappears_elsewhere_was_not_fast),
        cmocka_unit_test(devices_are_counted_by_what_they_measured),
    };
    return cmocka_run_group_tests_name("onlooking", tests, NULL, NULL);
}
