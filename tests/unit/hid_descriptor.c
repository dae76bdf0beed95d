// Report descriptors made here, good and malformed.

#include "drivers/hid_descriptor.h"

#include "random.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

static const uint8_t handle_descriptor[] = {
    0x05, 0x01, 0x09, 0x04, 0xa1, 0x01,             // joystick
    0x85, 0x02, 0x75, 0x08, 0x95, 0x01, 0x81, 0x01, // report 2: padding
    0x09, 0x38, 0x81, 0x06,                         // a wheel, relative
    0x09, 0x36, 0x16, 0x18, 0xfc, 0x26, 0xe8, 0x03, // slider, -1000 to 1000
    0x75, 0x10, 0x81, 0x02,                         //
    0xa4, 0x05, 0x09, 0x19, 0x01, 0x29, 0x03,       // three buttons
    0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95, 0x03, //
    0x81, 0x02, 0xb4, 0x75, 0x05, 0x81, 0x03, 0xc0,
};

static void a_handle_is_read_field_by_field(void **state) {
    (void)state;
    static struct hid_descriptor d;
    struct error err = {{0}};
    if (hid_descriptor_read(handle_descriptor, sizeof handle_descriptor, &d, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(5, d.count);
    assert_true(d.fields[0].is_relative);
    const struct hid_descriptor_field *slider = &d.fields[1], *button = &d.fields[2];
    assert_int_equal(1, slider->collection_page);
    assert_int_equal(4, slider->collection);
    assert_int_equal(1, slider->usage_page);
    assert_int_equal(0x36, slider->usage);
    assert_int_equal(2, slider->place.report);
    assert_int_equal(16, slider->place.bit);
    assert_int_equal(16, slider->place.count);
    assert_int_equal(-1000, slider->low);
    assert_int_equal(1000, slider->high);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(9, button[i].usage_page);
        assert_int_equal(1 + i, button[i].usage);
        assert_int_equal(32 + i, button[i].place.bit);
        assert_int_equal(1, button[i].high);
    }
}

static void a_proposal_is_what_a_config_takes(void **state) {
    (void)state;
    static struct hid_descriptor d;
    char text[HID_PROPOSAL_BYTES_MAX];
    assert_int_equal(RESULT_OK,
                     hid_descriptor_read(handle_descriptor, sizeof handle_descriptor, &d, NULL));
    hid_propose(&d, CHANNEL_SHAVER, text);
    assert_string_equal("usage = 0x0001 0x0004\n"
                        "shaver.opening = 2:16 16 -1000 1000\n"
                        "shaver.buttons = 2:32 3\n",
                        text);
    struct hid_axis axis;
    struct hid_field field;
    assert_true(hid_axis_parse("2:16 16 -1000 1000", &axis));
    assert_true(hid_field_parse("2:32 3", &field));
}

static void nothing_is_proposed_for_a_device_without_axis_and_buttons(void **state) {
    (void)state;
    static struct hid_descriptor d;
    char text[HID_PROPOSAL_BYTES_MAX];
    assert_int_equal(RESULT_OK, hid_descriptor_read(NULL, 0, &d, NULL));
    hid_propose(&d, CHANNEL_PUNCH, text);
    assert_string_equal("", text);
}

static void malformed_descriptors_are_refused_with_the_byte(void **state) {
    (void)state;
    static const struct {
        const char *what;
        uint8_t bytes[24];
        size_t size, at;
    } rows[] = {
        {"an item cut short", {0x05}, 1, 0},
        {"four bytes cut short", {0x05, 0x01, 0x27, 1, 2, 3}, 6, 2},
        {"a long item cut short", {0xfe, 0x02, 0x10, 0x00}, 4, 0},
        {"a long item without a length", {0xfe}, 1, 0},
        {"a collection that does not end", {0x09, 0x01, 0xa1, 0x01}, 4, 4},
        {"an end without a beginning", {0xc0}, 1, 0},
        {"a pop without a push", {0xb4}, 1, 0},
        {"nine pushes", {0xa4, 0xa4, 0xa4, 0xa4, 0xa4, 0xa4, 0xa4, 0xa4, 0xa4}, 9, 8},
        {"report 0", {0x85, 0x00}, 2, 0},
        {"report 256", {0x86, 0x00, 0x01}, 3, 0},
        {"a field outside", {0x75, 0x08, 0x95, 0x01, 0x81, 0x02}, 6, 4},
        {"no bits", {0xa1, 0x01, 0x95, 0x01, 0x81, 0x02, 0xc0}, 7, 4},
        {"257 bits", {0xa1, 0x01, 0x76, 0x01, 0x01, 0x95, 0x01, 0x81, 0x02, 0xc0}, 10, 7},
        {"a report too long", {0xa1, 0x01, 0x75, 0x20, 0x96, 0x01, 0x04, 0x81, 0x01, 0xc0}, 10, 7},
        {"a count that would overflow",
         {0xa1, 0x01, 0x75, 0x10, 0x97, 0x00, 0x00, 0x00, 0x10, 0x81, 0x01, 0xc0},
         12,
         9},
        {"bounds out of order",
         {0xa1, 0x01, 0x15, 0x05, 0x25, 0x04, 0x75, 0x08, 0x95, 0x01, 0x81, 0x02, 0xc0},
         13,
         10},
        {"signed bounds out of order",
         {0xa1, 0x01, 0x15, 0xff, 0x25, 0xfe, 0x75, 0x08, 0x95, 0x01, 0x81, 0x02, 0xc0},
         13,
         10},
        {"usages out of order", {0x19, 0x05, 0x29, 0x04}, 4, 2},
        {"only some reports numbered",
         {0xa1, 0x01, 0x75, 0x08, 0x95, 0x01, 0x81, 0x01, 0x85, 0x01, 0x81, 0x01, 0xc0},
         13,
         10},
    };
    static struct hid_descriptor d;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct error err = {{0}};
        char where[32];
        enum result result = hid_descriptor_read(rows[i].bytes, rows[i].size, &d, &err);
        snprintf(where, sizeof where, "byte %zu:", rows[i].at);
        if (result != RESULT_FORMAT || !strstr(err.text, where))
            fail_msg("%s: %d: %s", rows[i].what, result, err.text);
    }
}

static void too_much_is_refused(void **state) {
    (void)state;
    static struct hid_descriptor d;
    static uint8_t bytes[HID_DESCRIPTOR_BYTES_MAX + 1];
    static const uint8_t fields[] = {0xa1, 0x01, 0x25, 0x01, 0x75, 0x01,
                                     0x96, 0x01, 0x04, 0x81, 0x02, 0xc0};
    assert_int_equal(RESULT_LIMIT, hid_descriptor_read(bytes, sizeof bytes, &d, NULL));
    assert_int_equal(RESULT_LIMIT, hid_descriptor_read(fields, sizeof fields, &d, NULL));
    memset(bytes, 0x08, sizeof bytes); // usages without data
    assert_int_equal(RESULT_LIMIT, hid_descriptor_read(bytes, sizeof bytes - 1, &d, NULL));
    for (size_t i = 0; i < sizeof bytes - 1; i++)
        bytes[i] = 0xa0; // collections
    assert_int_equal(RESULT_FORMAT, hid_descriptor_read(bytes, sizeof bytes - 1, &d, NULL));
}

// Descriptors of random fields, some of them padding, and where each must be found.
static void random_fields_are_found_where_they_were_put(void **state) {
    (void)state;
    static struct hid_descriptor d;
    struct random random = {3};
    for (int n = 0; n < 500; n++) {
        uint8_t bytes[512] = {0x05, 0x01, 0x09, 0x04, 0xa1, 0x01};
        struct hid_descriptor_field want[40];
        int count = 0, bit[4] = {0};
        size_t size = 6;
        for (int i = 0; i < 20; i++) {
            int report = 1 + (int)(random_bits(&random) % 3),
                bits = 1 + (int)random_bits(&random) % 32;
            bits = bits < 1 ? 1 : bits;
            bool padding = random_bits(&random) % 4 == 0;
            int times = 1 + (int)(random_bits(&random) % 2),
                usage = (int)(random_bits(&random) % 256);
            uint8_t low = (uint8_t)random_bits(&random) | 0x80;
            const uint8_t items[] = {
                0x85, (uint8_t)report,      0x75, (uint8_t)bits, 0x95, (uint8_t)times,
                0x09, (uint8_t)usage,       0x15, low,           0x25, 0x7f,
                0x81, padding ? 0x03 : 0x02};
            memcpy(bytes + size, items, sizeof items);
            size += sizeof items;
            for (int k = 0; k < times; k++, bit[report] += bits)
                if (!padding)
                    want[count++] =
                        (struct hid_descriptor_field){1,
                                                      4,
                                                      1,
                                                      (uint16_t)usage,
                                                      {(uint8_t)report, bit[report], bits},
                                                      (int8_t)low,
                                                      127,
                                                      false};
        }
        bytes[size++] = 0xc0;
        struct error err = {{0}};
        if (hid_descriptor_read(bytes, size, &d, &err) != RESULT_OK)
            fail_msg("%s", err.text);
        assert_int_equal(count, d.count);
        for (int i = 0; i < count; i++) {
            const struct hid_descriptor_field *f = &d.fields[i];
            assert_int_equal(want[i].place.report, f->place.report);
            assert_int_equal(want[i].place.bit, f->place.bit);
            assert_int_equal(want[i].place.count, f->place.count);
            assert_int_equal(want[i].usage, f->usage);
            assert_int_equal(want[i].low, f->low);
            assert_int_equal(want[i].high, f->high);
        }
    }
}

static void cut_and_flipped_descriptors_give_fields_within_bounds_or_an_error(void **state) {
    (void)state;
    static struct hid_descriptor d;
    struct random random = {4};
    for (int n = 0; n < 50000; n++) {
        uint8_t bytes[sizeof handle_descriptor];
        char text[HID_PROPOSAL_BYTES_MAX];
        memcpy(bytes, handle_descriptor, sizeof bytes);
        for (uint64_t k = random_bits(&random) % 4; k > 0; k--)
            bytes[random_bits(&random) % sizeof bytes] ^= (uint8_t)(1 << random_bits(&random) % 8);
        size_t size = random_bits(&random) % (sizeof bytes + 1);
        if (hid_descriptor_read(bytes, size, &d, NULL) != RESULT_OK)
            continue;
        for (int i = 0; i < d.count; i++) {
            const struct hid_field *f = &d.fields[i].place;
            assert_true(f->count >= 1 && f->count <= 32);
            assert_true(f->bit >= 0 && f->bit + f->count <= 8 * HID_REPORT_BYTES_MAX);
        }
        hid_propose(&d, CHANNEL_PUNCH, text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_handle_is_read_field_by_field),
        cmocka_unit_test(a_proposal_is_what_a_config_takes),
        cmocka_unit_test(nothing_is_proposed_for_a_device_without_axis_and_buttons),
        cmocka_unit_test(malformed_descriptors_are_refused_with_the_byte),
        cmocka_unit_test(too_much_is_refused),
        cmocka_unit_test(random_fields_are_found_where_they_were_put),
        cmocka_unit_test(cut_and_flipped_descriptors_give_fields_within_bounds_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
