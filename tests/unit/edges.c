// Edges of what devices measure: which are markers, at what time, and the keys that name them.
#include "base/clock.h"
#include "drivers/modbus_edges.h"
#include "test.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MS NS_PER_MS

static struct device_reading reading;

static int set_up(void **state) {
    (void)state;
    reading = (struct device_reading){0};
    return 0;
}

static void see(struct edge *edge, double value, int64_t ms) {
    edge_see(edge, value, ms * MS, &reading);
}

static void assert_markers(int count, const int64_t *ms, const double *values) {
    assert_int_equal(reading.marker_count, count);
    for (int i = 0; i < count; i++) {
        assert_int_equal(reading.markers[i].time_ns, ms[i] * MS);
        assert_true(reading.markers[i].value == values[i]);
    }
}

static void what_goes_on_is_a_marker_and_what_goes_off_is_none(void **state) {
    (void)state;
    struct edge edge = {.name = "start"};
    for (int i = 0; i < 10; i++)
        see(&edge, i % 4 >= 2, 10 * i);
    assert_markers(2, (int64_t[]){20, 60}, (double[]){1, 1});
    assert_ptr_equal(reading.markers[0].name, edge.name);
}

static void both_are_markers_where_both_are_asked_for(void **state) {
    (void)state;
    struct edge edge = {.each = true};
    for (int i = 0; i < 10; i++)
        see(&edge, i % 4 >= 2, 10 * i);
    assert_markers(4, (int64_t[]){20, 40, 60, 80}, (double[]){1, 0, 1, 0});
}

static void what_a_device_says_first_is_no_edge(void **state) {
    (void)state;
    struct edge edge = {0};
    see(&edge, 1, 1);
    assert_int_equal(reading.marker_count, 0);
    see(&edge, 0, 20);
    edge_begin(&edge); // it was away, and nobody knows when it went on
    see(&edge, 1, 40);
    assert_int_equal(reading.marker_count, 0);
    see(&edge, 0, 60);
    see(&edge, 1, 80);
    assert_markers(1, (int64_t[]){80}, (double[]){1});
}

// The first edge counts, whatever the contact does within 5 ms; how it comes to rest counts, too.
static void a_contact_that_bounces_makes_one_marker(void **state) {
    (void)state;
    struct edge edge = {.each = true};
    static const int bounces[] = {0, 1, 0, 1, 0, 1, 1, 1, 1, 1, 1, 1};
    for (size_t ms = 0; ms < sizeof bounces / sizeof *bounces; ms++)
        see(&edge, bounces[ms], 100 + (int64_t)ms);
    assert_markers(1, (int64_t[]){101}, (double[]){1});
    see(&edge, 0, 112);
    for (int ms = 113; ms < 130; ms++)
        see(&edge, 1, ms);
    assert_markers(3, (int64_t[]){101, 112, 117}, (double[]){1, 0, 1});
}

static void each_change_of_a_register_is_one_and_no_value_is_none(void **state) {
    (void)state;
    struct edge edge = {.each = true};
    static const double values[] = {5, 5, 7, NAN, 7, 0, -2.5};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        see(&edge, values[i], 10 * (int64_t)i);
    assert_markers(3, (int64_t[]){20, 50, 60}, (double[]){7, 0, -2.5});
}

static void more_than_a_reading_has_room_for_are_counted(void **state) {
    (void)state;
    struct edge edge = {.each = true};
    for (int i = 0; i <= DEVICE_MARKERS_MAX + 3; i++)
        see(&edge, i, 10 * i);
    assert_int_equal(reading.marker_count, DEVICE_MARKERS_MAX);
    assert_int_equal(reading.markers_lost, 3);
}

// ---- of a Modbus slave --------------------------------------------------------------------------

static enum result read_keys(int count, const struct device_option *options, int first,
                             struct modbus_edges *out, struct error *err) {
    const struct device_config config = {"pedal", options, count};
    const struct modbus_numbering numbering = {.first = first};
    const struct modbus_request request = {.slave = 7, .timeout_ms = 50};
    return modbus_edges_read(&config, &numbering, &request, out, err);
}

static void coils_inputs_and_registers_are_asked_for_in_one_block_each(void **state) {
    (void)state;
    static const struct device_option options[] = {{"flexion", "40001"},
                                                   {"marker.a", "coil 12"},
                                                   {"marker.b", "coil 10 both"},
                                                   {"marker.c", "input 3"},
                                                   {"marker.d", "register 40006 0.5 1 i16"},
                                                   {"marker.e", "register 40009 u32"}};
    struct modbus_edges edges;
    struct error err;
    assert_int_equal(read_keys(6, options, 40001, &edges, &err), RESULT_OK);
    assert_int_equal(edges.count, 5);
    const struct modbus_request *coils = &edges.requests[MODBUS_COILS],
                                *inputs = &edges.requests[MODBUS_INPUTS];
    assert_true(coils->bits && !coils->input && inputs->bits && inputs->input);
    assert_int_equal(coils->slave, 7);
    assert_int_equal(coils->first, 9); // the maker counts from 1
    assert_int_equal(coils->count, 3);
    assert_int_equal(inputs->first, 2);
    assert_int_equal(inputs->count, 1);
    int low = 4, high = 4;
    modbus_edges_widen(&edges, &low, &high);
    assert_int_equal(low, 4);
    assert_int_equal(high, 9); // the second register of e
    uint16_t registers[] = {0, 0xfffe, 0, 0, 1, 2}, bits[] = {0, 0, 1};
    modbus_edges_see_registers(&edges, MODBUS_ABCD, 4, registers, 1 * MS, &reading);
    modbus_edges_see_bits(&edges, MODBUS_COILS, bits, 2 * MS, &reading);
    assert_int_equal(reading.marker_count, 0);
    registers[1] = 4;
    registers[5] = 3;
    bits[0] = 1, bits[2] = 0;
    modbus_edges_see_registers(&edges, MODBUS_ABCD, 4, registers, 11 * MS, &reading);
    modbus_edges_see_bits(&edges, MODBUS_COILS, bits, 12 * MS, &reading);
    assert_markers(3, (int64_t[]){11, 11, 12}, (double[]){3, 65539, 1});
    assert_string_equal(reading.markers[0].name, "d");
    assert_string_equal(reading.markers[2].name, "b");
}

static void keys_that_say_nothing_are_refused_by_name(void **state) {
    (void)state;
    static const struct device_option bad[] = {
        {"marker.", "coil 1"},
        {"marker.two words", "coil 1"},
        {"marker.a", "coil"},
        {"marker.a", "coil 65536"},
        {"marker.a", "coil -1"},
        {"marker.a", "coil 1 off"},
        {"marker.a", "input 1 2"},
        {"marker.a", "register"},
        {"marker.a", "register 1 x"},
        {"marker.a", "button 1"},
        {"marker.a", ""},
        {"marker.attempt.done", "coil 1"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct modbus_edges edges;
        struct error err = {""};
        if (read_keys(1, &bad[i], 0, &edges, &err) != RESULT_INVALID)
            fail_msg("%s = %s is taken", bad[i].key, bad[i].value);
        assert_non_null(strstr(err.text, bad[i].key));
        assert_non_null(strstr(err.text, "pedal"));
    }
    static const struct device_option apart[] = {{"marker.a", "coil 0"}, {"marker.b", "coil 125"}};
    struct modbus_edges edges;
    struct error err;
    assert_int_equal(read_keys(2, apart, 0, &edges, &err), RESULT_LIMIT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(what_goes_on_is_a_marker_and_what_goes_off_is_none, set_up),
        cmocka_unit_test_setup(both_are_markers_where_both_are_asked_for, set_up),
        cmocka_unit_test_setup(what_a_device_says_first_is_no_edge, set_up),
        cmocka_unit_test_setup(a_contact_that_bounces_makes_one_marker, set_up),
        cmocka_unit_test_setup(each_change_of_a_register_is_one_and_no_value_is_none, set_up),
        cmocka_unit_test_setup(more_than_a_reading_has_room_for_are_counted, set_up),
        cmocka_unit_test_setup(coils_inputs_and_registers_are_asked_for_in_one_block_each, set_up),
        cmocka_unit_test_setup(keys_that_say_nothing_are_refused_by_name, set_up),
    };
    return cmocka_run_group_tests_name("edges", tests, NULL, NULL);
}
