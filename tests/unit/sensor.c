// SENSOR messages and their units, as OpenIGTLink's own classes make them, and as the tracker's
// driver takes forces from them.

#include "base/clock.h"
#include "drivers/tracker_force.h"
#include "library_sensor.h"
#include "openigtlink_stream.h"
#include "random.h"
#include "test.h"

#include <openigtlink/igtl_unit.h>
#include <string.h>

enum { N = IGTL_UNIT_SI_DERIVED_NEWTON, G = IGTL_UNIT_SI_BASE_GRAM, M = IGTL_UNIT_SI_BASE_METER };
enum { S = IGTL_UNIT_SI_BASE_SECOND, HZ = IGTL_UNIT_SI_DERIVED_HERTZ };
enum { PA = IGTL_UNIT_SI_DERIVED_PASCAL, J = IGTL_UNIT_SI_DERIVED_JOULE };
enum { W = IGTL_UNIT_SI_DERIVED_WATT, V = IGTL_UNIT_SI_DERIVED_VOLT };

// As OpenIGTLink's C library packs it. (Its class igtl::Unit keeps only the last of several parts.)
static uint64_t library_unit(int prefix, const int units[6], const int exponents[6]) {
    igtl_unit_data data;
    igtl_unit_init(&data);
    data.prefix = (igtl_uint8)prefix;
    for (int i = 0; i < 6; i++) {
        data.unit[i] = (igtl_uint8)units[i];
        data.exp[i] = (igtl_int8)exponents[i];
    }
    return igtl_unit_pack(&data);
}

static void units_of_force_are_known_and_others_refused(void **state) {
    (void)state;
    static const struct {
        int prefix, units[6], exponents[6];
        double newtons; // 0: none of force
    } rows[] = {
        {IGTL_UNIT_PREFIX_NONE, {N}, {1}, 1},
        {IGTL_UNIT_PREFIX_MILLI, {N}, {1}, 1e-3},
        {IGTL_UNIT_PREFIX_MICRO, {N}, {1}, 1e-6},
        {IGTL_UNIT_PREFIX_KILO, {N}, {1}, 1e3},
        {IGTL_UNIT_PREFIX_CENTI, {N}, {1}, 1e-2},
        {IGTL_UNIT_PREFIX_KILO, {G, M, S}, {1, 1, -2}, 1},
        {IGTL_UNIT_PREFIX_NONE, {S, M, G}, {-2, 1, 1}, 1e-3},
        {IGTL_UNIT_PREFIX_NONE, {PA, M}, {1, 2}, 1},
        {IGTL_UNIT_PREFIX_NONE, {J, M}, {1, -1}, 1},
        {IGTL_UNIT_PREFIX_MILLI, {W, S, M}, {1, 1, -1}, 1e-3},
        {IGTL_UNIT_PREFIX_KILO, {G, M, HZ}, {1, 1, 2}, 1},
        {IGTL_UNIT_PREFIX_NONE, {N, M, M}, {1, 3, -3}, 1},
        {IGTL_UNIT_PREFIX_NONE, {N}, {2}, 0},
        {IGTL_UNIT_PREFIX_NONE, {N}, {-1}, 0},
        {IGTL_UNIT_PREFIX_NONE, {PA}, {1}, 0},
        {IGTL_UNIT_PREFIX_NONE, {V}, {1}, 0},
        {IGTL_UNIT_PREFIX_MILLI, {V, N}, {1, 1}, 0},
        {IGTL_UNIT_PREFIX_KILO, {G}, {1}, 0},
        {IGTL_UNIT_PREFIX_NONE, {N, M}, {1, 1}, 0},
        {IGTL_UNIT_PREFIX_NONE, {0}, {0}, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        uint64_t unit = library_unit(rows[i].prefix, rows[i].units, rows[i].exponents);
        double newtons = 0;
        struct error err;
        bool known = igtl_unit_newtons(unit, &newtons, &err) == RESULT_OK;
        if (known != (rows[i].newtons > 0) ||
            fabs(newtons - rows[i].newtons) > 1e-12 * rows[i].newtons)
            fail_msg("row %zu: %g", i, newtons);
    }
    assert_true(library_unit(0, (int[6]){N}, (int[6]){1}) == IGTL_UNIT_NEWTON);
}

static void no_unit_whatever_its_bits_makes_a_number_that_is_none(void **state) {
    (void)state;
    struct random random = {1};
    for (int i = 0; i < 100000; i++) {
        double newtons = 1;
        uint64_t unit =
            i % 2 ? random_bits(&random) : random_bits(&random) & UINT64_C(0xffff) << 48;
        if (igtl_unit_newtons(unit, &newtons, NULL) == RESULT_OK)
            assert_true(newtons > 0 && isfinite(newtons));
    }
}

// ---- messages -----------------------------------------------------------------------------------

static struct igtl_message said(const char *device, uint64_t unit, const double *values,
                                int count) {
    static struct bytes bytes;
    bytes.size = library_sensor(device, unit, values, count, bytes.data, sizeof bytes.data);
    struct report r = report_of(&bytes);
    if (r.count != 1 || r.events[0] != IGTL_SENSOR)
        fail_msg("%d events, the first %d: %s", r.count, r.events[0], r.err.text);
    return r.last;
}

static void the_numbers_are_those_of_the_sender(void **state) {
    (void)state;
    struct random random = {2};
    for (int i = 0; i < 200; i++) {
        double values[IGTL_SENSOR_VALUES_MAX];
        int count = 1 + (int)(random_bits(&random) % IGTL_SENSOR_VALUES_MAX);
        uint64_t unit = random_bits(&random);
        for (int k = 0; k < count; k++)
            values[k] = k == 5 ? NAN : k == 6 ? -INFINITY : random_between(&random, -1e6, 1e6);
        struct igtl_message m = said("Gauge", unit, values, count);
        assert_string_equal(m.device, "Gauge");
        assert_int_equal(m.sensor.count, count);
        assert_true(m.sensor.unit == unit);
        assert_memory_equal(m.sensor.values, values, (size_t)count * sizeof *values);
    }
}

static void what_we_write_is_what_the_library_writes(void **state) {
    (void)state;
    const struct igtl_sensor sensor = {3, IGTL_UNIT_NEWTON, {1.5, -2, 1e-300}};
    static uint8_t theirs[4096], ours[4096];
    size_t size = library_sensor("Gauge", IGTL_UNIT_NEWTON, sensor.values, 3, theirs, 4096);
    assert_int_equal(size, 58 + igtl_write_sensor(&sensor, ours));
    assert_memory_equal(theirs + 58, ours, size - 58);
}

static void a_sensor_that_lacks_bytes_or_has_too_many_is_refused(void **state) {
    (void)state;
    static const struct {
        size_t size;
        uint8_t count;
    } rows[] = {{0, 0}, {9, 0}, {10, 1}, {17, 1}, {18, 0}, {18, 2}, {19, 1}, {26, 1}, {26, 255}};
    uint8_t body[32] = {0};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        static struct bytes bytes;
        bytes.size = 0;
        body[0] = rows[i].count;
        append_message(&bytes, 1, "SENSOR", "Gauge", body, rows[i].size);
        struct report r = report_of(&bytes);
        if (r.count != 1 || r.events[0] != IGTL_REFUSED)
            fail_msg("row %zu: event %d", i, r.events[0]);
    }
}

// ---- forces -------------------------------------------------------------------------------------

static struct tracker_force forces[CHANNEL_COUNT];

static void configure(const struct device_option *options, int count) {
    const struct device_config config = {"gauge", options, count};
    struct device_outputs outputs = {0};
    struct error err;
    memset(forces, 0, sizeof forces);
    if (tracker_force_configure(&config, forces, &outputs, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(outputs.outputs[0].kind, SAMPLE_FORCE);
    tracker_force_begin(forces);
}

// The force, or why there is none; NAN: it was no news.
static double taken(const struct igtl_message *m, int64_t arrival_ns, struct error *err) {
    struct device_reading reading = {0};
    bool is_ours;
    err->text[0] = '\0';
    enum result result = tracker_force_take(forces, true, m, arrival_ns, &reading, &is_ours, err);
    assert_true(is_ours);
    assert_int_equal(result == RESULT_OK, err->text[0] == '\0');
    return reading.count ? reading.samples[0].force_n : NAN;
}

static void a_force_is_an_element_or_the_length_of_three(void **state) {
    (void)state;
    const double values[] = {3000, 2, 4, 4};
    const uint64_t milli = library_unit(IGTL_UNIT_PREFIX_MILLI, (int[6]){N}, (int[6]){1});
    static const struct {
        const char *key, *value, *other, *other_value;
        uint64_t unit; // 0: newtons, 1: millinewtons
        double force_n;
    } rows[] = {
        {"elements.probe", "1", "zero.probe", "0", 1, 3},
        {"elements.probe", "2", "zero.probe", "0.5", 0, 1.5},
        {"elements.probe", "2", "zero.probe", "5", 0, -3},
        {"elements.probe", "2 3 4", "zero.probe", "0 0 0", 0, 6},
        {"elements.probe", "4 2 3", "zero.probe", "4, 2, 4", 0, 0},
        {"elements.probe", "2", "scale.probe", "-9.81", 0, -19.62},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct device_option options[] = {{"force.probe", "Gauge"},
                                                {rows[i].key, rows[i].value},
                                                {rows[i].other, rows[i].other_value}};
        struct error err;
        configure(options, 3);
        struct igtl_message m = said("Gauge", rows[i].unit ? milli : IGTL_UNIT_NEWTON, values, 4);
        assert_near(taken(&m, NS_PER_S, &err), rows[i].force_n, 1e-9);
    }
}

static void what_is_no_force_is_said_with_its_device(void **state) {
    (void)state;
    const double values[] = {1, NAN, INFINITY};
    const uint64_t volt = library_unit(IGTL_UNIT_PREFIX_MILLI, (int[6]){V, M}, (int[6]){-1, 1});
    static const struct {
        const char *elements;
        int unit; // 0: newtons, 1: volts, 2: none
        const char *complaint;
    } rows[] = {{"1", 1, "SENSOR of Gauge: its unit mV^-1 m is not one of force"},
                {"1", 2, "SENSOR of Gauge: it gives no unit"},
                {"2", 0, "SENSOR of Gauge: number 2 is not finite"},
                {"3", 0, "SENSOR of Gauge: number 3 is not finite"},
                {"4", 0, "SENSOR of Gauge: it has 3 numbers, and no number 4"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct device_option options[] = {{"force.tibia", "Gauge"},
                                                {"elements.tibia", rows[i].elements}};
        struct error err;
        configure(options, 2);
        struct igtl_message m =
            said("Gauge", (uint64_t[]){IGTL_UNIT_NEWTON, volt, 0}[rows[i].unit], values, 3);
        assert_true(isnan(taken(&m, NS_PER_S, &err)));
        assert_string_equal(err.text, rows[i].complaint);
    }
}

static void stamps_that_stand_still_while_the_force_changes_are_not_used(void **state) {
    (void)state;
    const struct device_option options[] = {{"force.probe", "Gauge"}};
    struct error err;
    configure(options, 1);
    int used = 0;
    for (int i = 0; i < 50; i++) {
        struct igtl_message m = said("Gauge", IGTL_UNIT_NEWTON, (double[]){i}, 1);
        m.stamp_ns = 1000 * NS_PER_S;
        used += taken(&m, NS_PER_S + i * 20 * NS_PER_MS, &err) == i;
    }
    assert_in_range(used, 40, 46);
}

static void a_force_that_is_said_again_is_no_news_and_a_late_one_refused(void **state) {
    (void)state;
    const struct device_option options[] = {{"force.probe", "Gauge"}};
    struct error err;
    configure(options, 1);
    for (int i = 0; i < 20; i++) {
        struct igtl_message m = said("Gauge", IGTL_UNIT_NEWTON, (double[]){i}, 1);
        int64_t sent_ns = 1000 * NS_PER_S + i * 10 * NS_PER_MS, late_ns = i == 10 ? NS_PER_S : 0;
        m.stamp_ns = sent_ns - late_ns;
        double force_n = taken(&m, sent_ns, &err);
        assert_int_equal(isnan(force_n), i == 10);
        assert_int_equal(strstr(err.text, "ms late") != NULL, i == 10);
        if (i != 10)
            assert_true(isnan(taken(&m, sent_ns + NS_PER_MS, &err)));
    }
}

static void configs_that_are_wrong_are_refused_with_their_key(void **state) {
    (void)state;
    static const struct {
        struct device_option options[3];
        const char *complaint;
    } rows[] = {
        {{{"force.joint", "Gauge"}}, "force.joint: the joint has no force"},
        {{{"force.probe", ""}}, "force.probe: a name has 1 to 20 bytes"},
        {{{"force.probe", "a name of 21 letters."}}, "force.probe: a name has 1 to 20 bytes"},
        {{{"force.probe", "G"}, {"elements.probe", "0"}}, "\"0\" is neither one number from 1"},
        {{{"force.probe", "G"}, {"elements.probe", "1 2"}}, "elements.probe: \"1 2\" is neither"},
        {{{"force.probe", "G"}, {"elements.probe", "1.5"}}, "elements.probe: \"1.5\" is neither"},
        {{{"force.probe", "G"}, {"elements.probe", "256"}}, "elements.probe: \"256\" is neither"},
        {{{"force.probe", "G"}, {"scale.probe", "0"}}, "scale.probe: \"0\" is not a number of"},
        {{{"force.probe", "G"}, {"zero.probe", "1 2 3"}}, "zero.probe: \"1 2 3\" is not a number"},
        {{{"force.probe", "G"}, {"zero.probe", "x"}}, "zero.probe: \"x\" is not a number"},
        {{{"force.probe", "G"}, {"zero.tibia", "1"}}, "zero.tibia: the section has no force of it"},
        {{{"elements.probe", "1"}}, "elements.probe: the section has no force of it"},
        {{{"scale.probe", "1"}}, "scale.probe: \"1\": the section has no force of it"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct device_config config = {"gauge", rows[i].options, 0};
        struct device_outputs outputs = {0};
        struct error err = {{0}};
        while (config.option_count < 3 && rows[i].options[config.option_count].key)
            config.option_count++;
        memset(forces, 0, sizeof forces);
        if (tracker_force_configure(&config, forces, &outputs, &err) != RESULT_INVALID ||
            !strstr(err.text, rows[i].complaint))
            fail_msg("row %zu: %s", i, err.text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(units_of_force_are_known_and_others_refused),
        cmocka_unit_test(no_unit_whatever_its_bits_makes_a_number_that_is_none),
        cmocka_unit_test(the_numbers_are_those_of_the_sender),
        cmocka_unit_test(what_we_write_is_what_the_library_writes),
        cmocka_unit_test(a_sensor_that_lacks_bytes_or_has_too_many_is_refused),
        cmocka_unit_test(a_force_is_an_element_or_the_length_of_three),
        cmocka_unit_test(what_is_no_force_is_said_with_its_device),
        cmocka_unit_test(stamps_that_stand_still_while_the_force_changes_are_not_used),
        cmocka_unit_test(a_force_that_is_said_again_is_no_news_and_a_late_one_refused),
        cmocka_unit_test(configs_that_are_wrong_are_refused_with_their_key),
    };
    return cmocka_run_group_tests_name("sensor", tests, NULL, NULL);
}
