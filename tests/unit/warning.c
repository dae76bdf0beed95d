// Of all that is wrong with a station, what is most urgent.
#include "live/warning.h"

#include "base/clock.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

#define DAY_S 86400

static arthron_Place good(void) {
    arthron_Place place = {.devices_count = 2};
    place.info = (arthron_SessionInfo){.connected = true,
                                       .state = arthron_SessionState_RUNNING,
                                       .clock_uncertainty_us = 300,
                                       .touches = 100,
                                       .drift_mm = 0.3};
    strcpy(place.info.case_grade, "fit with warnings");
    strcpy(place.info.case_name, "arthrosis");
    strcpy(place.devices[0].name, "encoders");
    strcpy(place.devices[1].name, "tracker");
    return place;
}

static void assert_warns(arthron_Place place, enum urgency urgency, const char *text) {
    warning_of_place(&place, 0.5);
    assert_int_equal(place.urgency, urgency);
    if (!strstr(place.warning, text) || (urgency == URGENCY_NONE && place.warning[0]))
        fail_msg("it says: %s", place.warning);
}

static void a_program_reads_a_code_and_its_parameters(void **state) {
    (void)state;
    arthron_Place place = good();
    warning_of_place(&place, 0.5);
    assert_false(place.has_why);
    place.devices[1].lost = true;
    warning_of_place(&place, 0.5);
    assert_true(place.has_why);
    assert_int_equal(place.why.code, arthron_Why_Code_DEVICE_LOST);
    assert_int_equal(place.why.parameters_count, 1);
    assert_string_equal(place.why.parameters[0], "tracker");
    place.devices[1].lost = false, strcpy(place.info.case_grade, "unchecked");
    for (int i = 0; i < 2; i++) // made anew each second
        warning_of_place(&place, 0.5);
    assert_int_equal(place.why.code, arthron_Why_Code_CASE_GRADE);
    assert_int_equal(place.why.parameters_count, 2);
    assert_string_equal(place.why.parameters[0], "arthrosis");
    assert_string_equal(place.why.parameters[1], "unchecked");
}

static void each_thing_is_told_of(void **state) {
    (void)state;
    arthron_Place place = good();
    assert_warns(place, URGENCY_NONE, "");
    place = good(), place.info.connected = false;
    assert_warns(place, URGENCY_NOW, "away");
    place = good(), place.devices[1].lost = true;
    assert_warns(place, URGENCY_NOW, "tracker is lost");
    place = good(), place.info.trace_failing = true;
    assert_warns(place, URGENCY_NOW, "disk");
    place = good(), place.info.trace_missing = 12;
    assert_warns(place, URGENCY_ACT, "12 steps");
    place = good(), place.info.unprotected = true;
    assert_warns(place, URGENCY_LOOK, "no other server");
    place = good(), place.info.drift_mm = 0.7;
    assert_warns(place, URGENCY_ACT, "0.70 mm");
    place = good(), place.info.drift_mm = 0.7, place.info.touches = 2;
    assert_warns(place, URGENCY_NONE, "");
    place = good(), place.loss_share = 0.2f;
    assert_warns(place, URGENCY_ACT, "20 %");
    place = good(), place.loss_share = 0.03f;
    assert_warns(place, URGENCY_LOOK, "3 %");
    place = good(), place.late_share = 0.2f;
    assert_warns(place, URGENCY_LOOK, "20 % of its frames come late");
    place = good(), place.info.clock_step_ns = -2 * NS_PER_S;
    assert_warns(place, URGENCY_LOOK, "stepped by -2.0 s");
    place = good(), place.info.rtt_p50_us = 250000;
    assert_warns(place, URGENCY_LOOK, "waits 250 ms");
    place = good(), place.info.without_datagrams = true;
    assert_warns(place, URGENCY_LOOK, "over TCP");
    place = good(), place.info.slowed = 1, place.info.frames_excess = 1200;
    place.loss_share = 0.03f;
    assert_warns(place, URGENCY_LOOK, "more than its share: 1200 frames");
    place = good(), place.info.slowed = 2;
    assert_warns(place, URGENCY_LOOK, "asks for its meshes too often");
    place = good(), place.info.slowed = 4;
    assert_warns(place, URGENCY_LOOK, "too many messages");
    place = good(), place.pause_s = 2.2f;
    assert_warns(place, URGENCY_NOW, "no frame came from its station for 2 s");
    place.info.connected = false;
    assert_warns(place, URGENCY_NOW, "away");
    place = good(), place.pause_s = 0.9f;
    assert_warns(place, URGENCY_NONE, "");
    place = good(), strcpy(place.info.case_grade, "unfit");
    assert_warns(place, URGENCY_ACT, "unfit");
    place = good(), strcpy(place.info.case_grade, "not checked");
    assert_warns(place, URGENCY_LOOK, "case arthrosis is not checked");
    place = good(), place.info.clock_uncertainty_us = 12000;
    assert_warns(place, URGENCY_LOOK, "12 ms");
    place = good(),
    place.info.certificate_until_utc_s = clock_utc_ns() / NS_PER_S + 10 * DAY_S + 60;
    assert_warns(place, URGENCY_LOOK, "certificate ends in 10 days");
    place.info.certificate_until_utc_s += 21 * DAY_S;
    assert_warns(place, URGENCY_NONE, "");
    place = good(), strcpy(place.info.calibration_problem, "its calibration is 40 days old");
    assert_warns(place, URGENCY_LOOK, "40 days");
}

static void the_most_urgent_is_told(void **state) {
    (void)state;
    arthron_Place place = good();
    strcpy(place.info.calibration_problem, "old");
    strcpy(place.info.case_grade, "unfit");
    assert_warns(place, URGENCY_ACT, "unfit");
    place.devices[0].lost = true;
    assert_warns(place, URGENCY_NOW, "encoders");
    place.info.connected = false; // then its devices say nothing
    assert_warns(place, URGENCY_NOW, "away");
}

static void where_nobody_trains_nothing_is_urgent(void **state) {
    (void)state;
    arthron_Place place = good();
    place.info.connected = false;
    place.info.state = arthron_SessionState_CLOSED;
    place.info.trace_missing = 3;
    strcpy(place.info.case_grade, "not checked");
    assert_warns(place, URGENCY_NONE, "");
    strcpy(place.refused, "no memory left"); // somebody wants to train
    assert_warns(place, URGENCY_NOW, "no memory left");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_thing_is_told_of),
        cmocka_unit_test(a_program_reads_a_code_and_its_parameters),
        cmocka_unit_test(the_most_urgent_is_told),
        cmocka_unit_test(where_nobody_trains_nothing_is_urgent),
    };
    return cmocka_run_group_tests_name("warning", tests, NULL, NULL);
}
