// What reports of HID devices say, and what configs may ask of them: no device.

#include "drivers/device.h"
#include "drivers/hid_report.h"
#include "random.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

static struct hid_axis axis(const char *text) {
    struct hid_axis axis = {.dead = 0};
    if (!hid_axis_parse(text, &axis))
        fail_msg("%s", text);
    return axis;
}

static const struct handle *punch(const struct hid_state *state) {
    return &state->handles[CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT];
}

static struct hid_layout punch_layout(const char *opening, const char *buttons) {
    struct hid_layout layout = {0};
    struct hid_handle *handle = &layout.handles[CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT];
    assert_true(!opening || hid_axis_parse(opening, &handle->opening));
    assert_true(!buttons || hid_field_parse(buttons, &handle->buttons));
    return layout;
}

static const uint32_t punch_bit = 1u << (CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT);

// ---- fields -------------------------------------------------------------------------------------

// Puts a field into a report bit by bit.
static void put(uint8_t *bytes, int bit, int count, uint64_t value) {
    for (int i = 0; i < count; i++) {
        uint8_t mask = (uint8_t)(1 << (bit + i) % 8);
        bytes[(bit + i) / 8] &= (uint8_t)~mask;
        if (value >> i & 1)
            bytes[(bit + i) / 8] |= mask;
    }
}

static void a_field_is_read_wherever_its_bits_lie(void **state) {
    (void)state;
    struct random random = {1};
    for (int n = 0; n < 20000; n++) {
        uint8_t bytes[64];
        for (size_t i = 0; i < sizeof bytes; i++)
            bytes[i] = (uint8_t)random_bits(&random);
        int count = 1 + (int)(random_bits(&random) % 32);
        int bit = (int)(random_bits(&random) % (8 * sizeof bytes - (unsigned)count + 1));
        uint32_t value = (uint32_t)(random_bits(&random) & ((UINT64_C(1) << count) - 1));
        put(bytes, bit, count, value);
        struct hid_layout layout = punch_layout(NULL, "0 1");
        layout.handles[CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT].buttons =
            (struct hid_field){0, bit, count};
        struct hid_state values = {0};
        uint32_t news;
        assert_int_equal(RESULT_OK,
                         hid_report_read(&layout, bytes, sizeof bytes, &values, &news, NULL));
        assert_int_equal(value, punch(&values)->buttons);
        assert_int_equal(punch_bit, news);
    }
}

static void an_opening_runs_from_closed_to_open(void **state) {
    (void)state;
    static const struct {
        const char *layout;
        uint8_t bytes[4];
        double opening;
    } rows[] = {
        {"0 8 0 255", {0}, 0},
        {"0 8 0 255", {255}, 1},
        {"0 8 0 255", {51}, 0.2},
        {"0 8 200 100", {200}, 0},
        {"0 8 200 100", {125}, 0.75},
        {"0 8 200 100", {20}, 1},
        {"0 8 200 100", {255}, 0},
        {"0 8 -100 100", {0x9c}, 0}, // -100
        {"0 8 -100 100", {0}, 0.5},
        {"0 8 -100 100", {0x80}, 0}, // -128
        {"4 12 0 4000", {0x80, 0x3e}, 0.25},
        {"4 12 0 4000", {0x8f, 0x3e}, 0.25},
        {"0 16 -32768 32767", {0xff, 0x7f}, 1},
        {"0 32 0 4294967295", {0xff, 0xff, 0xff, 0xff}, 1},
        {"0 32 -2147483648 0", {0, 0, 0, 0xc0}, 0.5},
        {"0 8 0 200 0.1", {20}, 0},
        {"0 8 0 200 0.1", {100}, 0.5},
        {"0 8 0 200 0.1", {60}, 0.25},
        {"0 8 0 200 0.1", {180}, 1},
        {"0 8 0 200 0.1", {190}, 1},
        {"1 1 0 1", {2}, 1},
        {"0 8 0 100 signed", {0xfb}, 0}, // -5, a trigger at rest
        {"0 8 10 100 0.1 signed", {0xfb}, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct hid_layout layout = punch_layout(rows[i].layout, NULL);
        struct hid_state values = {0};
        uint32_t news;
        assert_int_equal(RESULT_OK,
                         hid_report_read(&layout, rows[i].bytes, 4, &values, &news, NULL));
        if (fabs(punch(&values)->opening - rows[i].opening) > 1e-12)
            fail_msg("%s: row %zu: %g", rows[i].layout, i, punch(&values)->opening);
    }
}

static void an_opening_never_goes_back_while_the_raw_value_goes_on(void **state) {
    (void)state;
    struct random random = {2};
    for (int n = 0; n < 200; n++) {
        struct hid_axis a = axis("0 16 -1000 3000");
        a.dead = random_between(&random, 0, 0.4);
        a.closed = (int64_t)random_between(&random, -2000, 0);
        double last = 0;
        for (int64_t raw = -32768; raw < 32768; raw += 37) {
            double opening = hid_opening(&a, raw);
            assert_true(opening >= last && opening <= 1);
            last = opening;
        }
        assert_true(last == 1);
    }
}

// Of any width, sign, scale and place: what a field says is its number, and nothing at its ends.
static void a_force_is_its_field_by_scale_and_offset(void **state) {
    (void)state;
    struct random random = {3};
    for (int n = 0; n < 20000; n++) {
        uint8_t bytes[16] = {0};
        bool is_signed = n % 2;
        int count = 8 + (int)(random_bits(&random) % 25), bit = (int)(random_bits(&random) % 80);
        int64_t range = INT64_C(1) << count, lowest = is_signed ? -range / 2 : 0;
        int64_t raw = lowest + (int64_t)(random_bits(&random) & (uint64_t)(range - 1));
        if (n % 10 == 0)
            raw = lowest + range - 1;
        if (n % 10 == 1)
            raw = lowest; // n is odd: signed
        double scale = random_between(&random, -2, 2), offset = random_between(&random, -5, 5);
        char text[128];
        snprintf(text, sizeof text, "%d %d %.12g %.12g %s", bit, count, scale, offset,
                 is_signed ? "signed" : "unsigned");
        struct hid_layout layout = {.forces[CHANNEL_TIBIA] = {.force.count = 1}};
        struct hid_state values = {0};
        uint32_t news;
        put(bytes, bit, count, (uint64_t)raw);
        assert_true(hid_gauge_parse(text, &layout.forces[CHANNEL_TIBIA].parts[0]));
        assert_int_equal(RESULT_OK,
                         hid_report_read(&layout, bytes, sizeof bytes, &values, &news, NULL));
        assert_int_equal(news, 1u << (HID_FORCE_NEWS + CHANNEL_TIBIA));
        double got = values.forces_n[CHANNEL_TIBIA][0], want = scale * (double)raw + offset;
        if (n % 10 < 2)
            assert_true(isnan(got));
        else if (raw != lowest && raw != lowest + range - 1)
            assert_near(got, want, 1e-9 * (1 + fabs(want)));
    }
}

static void a_gauge_that_is_none_is_refused(void **state) {
    (void)state;
    static const char *const wrong[] = {"",       "0",           "0 33",         "-1 8",
                                        "0 8 x",  "0 8 1 2 3",   "0 8 1 2 sign", "0 8 1e10",
                                        "signed", "0 8 signed 1"};
    struct hid_gauge gauge;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        if (hid_gauge_parse(wrong[i], &gauge))
            fail_msg("taken: \"%s\"", wrong[i]);
    assert_true(hid_gauge_parse("3:16 12 unsigned", &gauge));
    assert_int_equal(gauge.field.report, 3);
    assert_false(gauge.is_signed);
    assert_near(gauge.scale, 1, 0);
}

static void values_come_from_the_reports_that_carry_them(void **state) {
    (void)state;
    struct hid_layout layout = punch_layout("1:0 8 0 100", "2:4 4");
    int i = CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT;
    struct hid_state values = {0};
    uint32_t news;
    assert_true(hid_layout_is_numbered(&layout));
    assert_int_equal(RESULT_OK, hid_report_read(&layout, (uint8_t[]){3, 77}, 2, &values, &news, 0));
    assert_int_equal(0, news);
    assert_int_equal(RESULT_OK, hid_report_read(&layout, (uint8_t[]){1, 50}, 2, &values, &news, 0));
    assert_int_equal(punch_bit, news);
    assert_false(hid_state_is_whole(&layout, &values, i));
    assert_int_equal(RESULT_OK,
                     hid_report_read(&layout, (uint8_t[]){2, 0xa0}, 2, &values, &news, 0));
    assert_true(hid_state_is_whole(&layout, &values, i));
    assert_near(0.5, punch(&values)->opening, 1e-12);
    assert_int_equal(10, punch(&values)->buttons);
}

static void a_report_that_is_too_short_changes_nothing(void **state) {
    (void)state;
    struct hid_layout layout = punch_layout("1:0 8 0 100", "1:16 9");
    struct hid_state values = {0}, before;
    uint32_t news;
    static const uint8_t report[] = {1, 100, 0, 3, 1};
    assert_int_equal(RESULT_OK, hid_report_read(&layout, report, 5, &values, &news, NULL));
    assert_int_equal(0x103, punch(&values)->buttons);
    before = values;
    for (size_t size = 0; size < 5; size++) {
        struct error err;
        uint8_t copy[5] = {1, 7, 7, 7, 7};
        assert_int_equal(RESULT_FORMAT, hid_report_read(&layout, copy, size, &values, &news, &err));
        assert_int_equal(0, news);
        assert_memory_equal(&before, &values, sizeof values);
    }
}

// ---- configs ------------------------------------------------------------------------------------

#define IDENTITY                                                                                   \
    {"vid", "1209"}, {                                                                             \
        "pid", "0001"                                                                              \
    }

static enum result create(const struct device_option *options, int count, struct error *err) {
    struct device_config config = {"handle", options, count};
    struct device_outputs outputs = {0};
    void *device;
    const struct device_driver *driver = device_driver("hid");
    enum result result = driver->create(&config, &device, &outputs, err);
    if (result == RESULT_OK) {
        assert_int_equal(1, outputs.count);
        assert_int_equal(CHANNEL_PUNCH, outputs.outputs[0].channel);
        assert_int_equal(SAMPLE_HANDLE, outputs.outputs[0].kind);
        driver->destroy(device);
    }
    return result;
}

static void a_handle_may_be_named_in_many_ways(void **state) {
    (void)state;
    static const struct device_option rows[][6] = {
        {IDENTITY, {"punch.opening", "0 8 0 255"}},
        {{"vid", "0x1209"}, {"pid", "0x1"}, {"punch.buttons", "8 2"}},
        {IDENTITY, {"serial", "A 17"}, {"usage", "0xff00 1"}, {"punch.buttons", "1:8 32"}},
        {IDENTITY, {"on_change", "no"}, {"punch.opening", "3:0 16 60000 3 .4"}},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct error err = {{0}};
        int count = 0;
        while (count < 6 && rows[i][count].key)
            count++;
        if (create(rows[i], count, &err) != RESULT_OK)
            fail_msg("row %zu: %s", i, err.text);
    }
}

static void configs_that_cannot_work_are_refused_by_key(void **state) {
    (void)state;
    static const struct {
        struct device_option options[4];
        enum result result;
        const char *text;
    } rows[] = {
        {{{"pid", "1"}, {"punch.buttons", "0 1"}}, RESULT_MISSING, "vid"},
        {{{"vid", "1"}, {"punch.buttons", "0 1"}}, RESULT_MISSING, "pid"},
        {{IDENTITY}, RESULT_MISSING, "CHANNEL.opening"},
        {{IDENTITY, {"punch.opening", ""}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0 8 0"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0 8 0 256"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0 8 -1 128"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0 8 -129 0"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0 8 7 7"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0 8 0 9 0.5"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0 8 0 9 0 0"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0 33 0 9"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "0:0 8 0 9"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "256:0 8 0 9"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.opening", "-1 8 0 9"}}, RESULT_INVALID, "punch.opening"},
        {{IDENTITY, {"punch.buttons", "0"}}, RESULT_INVALID, "punch.buttons"},
        {{IDENTITY, {"punch.buttons", "0 0"}}, RESULT_INVALID, "punch.buttons"},
        {{IDENTITY, {"punch.buttons", "0 1 2"}}, RESULT_INVALID, "punch.buttons"},
        {{IDENTITY, {"punch.buttons", "32767 2"}}, RESULT_INVALID, "punch.buttons"},
        {{IDENTITY, {"punch.buttons", "1:0 1"}, {"punch.opening", "0 8 0 9"}},
         RESULT_INVALID,
         "only some"},
        {{IDENTITY, {"punch.buttons", "0 1"}, {"usage", "1"}}, RESULT_INVALID, "usage"},
        {{IDENTITY, {"punch.buttons", "0 1"}, {"usage", "0 1"}}, RESULT_INVALID, "usage"},
        {{IDENTITY, {"punch.buttons", "0 1"}, {"usage", "1 4 4"}}, RESULT_INVALID, "usage"},
        {{IDENTITY, {"punch.buttons", "0 1"}, {"usage", "10000 4"}}, RESULT_INVALID, "usage"},
        {{IDENTITY, {"tibia.buttons", "0 1"}}, RESULT_INVALID, "tibia.buttons"},
        {{IDENTITY, {"punch.buttons", "0 1"}, {"rate", "1"}}, RESULT_INVALID, "rate"},
        {{{"vid", "-1"}, {"pid", "1"}, {"punch.buttons", "0 1"}}, RESULT_INVALID, "vid"},
        {{{"vid", "12090"}, {"pid", "1"}, {"punch.buttons", "0 1"}}, RESULT_INVALID, "vid"},
        {{{"vid", "1"}, {"pid", "pad"}, {"punch.buttons", "0 1"}}, RESULT_INVALID, "pid"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct error err = {{0}};
        int count = 0;
        while (count < 4 && rows[i].options[count].key)
            count++;
        enum result result = create(rows[i].options, count, &err);
        if (result != rows[i].result || !strstr(err.text, rows[i].text) ||
            !strstr(err.text, "[device handle]"))
            fail_msg("row %zu: %d: %s", i, result, err.text);
    }
}

static void a_serial_that_is_too_long_is_refused(void **state) {
    (void)state;
    char serial[129];
    memset(serial, 'x', sizeof serial);
    serial[128] = 0;
    struct error err;
    struct device_option options[] = {IDENTITY, {"punch.buttons", "0 1"}, {"serial", serial}};
    assert_int_equal(RESULT_LIMIT, create(options, 4, &err));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_field_is_read_wherever_its_bits_lie),
        cmocka_unit_test(an_opening_runs_from_closed_to_open),
        cmocka_unit_test(an_opening_never_goes_back_while_the_raw_value_goes_on),
        cmocka_unit_test(a_force_is_its_field_by_scale_and_offset),
        cmocka_unit_test(a_gauge_that_is_none_is_refused),
        cmocka_unit_test(values_come_from_the_reports_that_carry_them),
        cmocka_unit_test(a_report_that_is_too_short_changes_nothing),
        cmocka_unit_test(a_handle_may_be_named_in_many_ways),
        cmocka_unit_test(configs_that_cannot_work_are_refused_by_key),
        cmocka_unit_test(a_serial_that_is_too_long_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
