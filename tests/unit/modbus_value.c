// How a Modbus value is written in a config, and what its registers say.
#include "drivers/modbus_value.h"

#include "test.h"

static const struct modbus_numbering from_0 = {0};

static struct modbus_value parsed(const char *text) {
    struct modbus_value v = {.kind = MODBUS_SIGNED, .bits = 16};
    if (!modbus_value_parse(text, &from_0, &v))
        fail_msg("refused: %s", text);
    return v;
}

static void bits_beyond_the_value_are_not_its_own(void **state) {
    (void)state;
    static const struct {
        const char *text;
        uint16_t words[2];
        double number;
    } rows[] = {
        {"0", {0xffff}, -1},
        {"0 u16", {0xffff}, 65535},
        {"0 unsigned", {0xffff}, 65535},
        {"0 u12", {0xf123}, 0x123},
        {"0 i12", {0x0fff}, -1},
        {"0 i12", {0x07ff}, 2047},
        {"0 u17", {0xfffe, 0x0001}, 1},
        {"0 u17", {0x0001, 0xffff}, 131071},
        {"0 i17", {0x0001, 0x0000}, -65536},
        {"0 u32", {0xffff, 0xffff}, 4294967295.0},
        {"0 i32", {0x8000, 0x0000}, -2147483648.0},
        {"0 f32", {0xc2ed, 0x4000}, -118.625},
        {"0 2 f32", {0x3f80, 0x0000}, 2},
        {"0 2 1 i32", {0x0000, 0x0005}, 11},
        {"0 360e-5 -180 u32", {0x0000, 0x0000}, -180},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct modbus_value v = parsed(rows[i].text);
        assert_near(modbus_value_number(&v, MODBUS_ABCD, rows[i].words), rows[i].number, 1e-9);
    }
}

static void a_whole_number_at_an_end_of_its_range_other_than_0_is_told(void **state) {
    (void)state;
    static const struct {
        const char *text;
        uint16_t words[2];
        bool at_end;
    } rows[] = {
        {"0", {0x8000}, true},
        {"0", {0x7fff}, true},
        {"0", {0x8001}, false},
        {"0", {0x7ffe}, false},
        {"0", {0}, false},
        {"0", {0xffff}, false},
        {"0 u16", {0xffff}, true},
        {"0 u16", {0}, false},
        {"0 u16", {0x8000}, false},
        {"0 u12", {0x0fff}, true},
        {"0 u12", {0xffff}, true},
        {"0 u12", {0xf7ff}, false},
        {"0 i12", {0xf800}, true},
        {"0 i24", {0x007f, 0xffff}, true},
        {"0 i32", {0x8000, 0}, true},
        {"0 u32", {0xffff, 0xffff}, true},
        {"0 i32", {0xffff, 0xffff}, false},
        {"0 u7", {0x7f}, false},
        {"0 f32", {0xffff, 0xffff}, false},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct modbus_value v = parsed(rows[i].text);
        if (modbus_value_is_at_end(&v, MODBUS_ABCD, rows[i].words) != rows[i].at_end)
            fail_msg("row %zu: %s", i, rows[i].text);
    }
}

static void only_a_register_with_scale_offset_and_type_is_a_value(void **state) {
    (void)state;
    static const char *const wrong[] = {
        "",
        "x",
        "-1",
        "0.5",
        "65536",
        "65535 u32",
        "0 f16",
        "0 f64",
        "0 u0",
        "0 u33",
        "0 i1",
        "0 u",
        "0 u1x",
        "0 f32 1",
        "0 1 2 3",
        "f32",
        "0 f",
        "0 d32",
        "1 1 0 signed unsigned",
    };
    struct modbus_value v = {.bits = 16};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        if (modbus_value_parse(wrong[i], &from_0, &v))
            fail_msg("taken: \"%s\"", wrong[i]);
    assert_int_equal(parsed("65535 u16").address, 65535);
    assert_int_equal(parsed("65534 f32").address, 65534);
}

static void a_makers_number_is_the_address_after_its_first_one(void **state) {
    (void)state;
    static const struct {
        const char *first, *text;
        int address; // -1: refused
    } rows[] = {{"1", "1", 0},
                {"1", "0", -1},
                {"40001", "40001", 0},
                {"40001", "40100", 99},
                {"40001", "100", -1},
                {"30001", "30017", 16},
                {"400001", "465536", 65535},
                {"400001", "465537", -1}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct modbus_numbering numbering;
        struct modbus_value v = {.kind = MODBUS_UNSIGNED, .bits = 16};
        assert_true(modbus_numbering_parse(rows[i].first, &numbering));
        bool good = modbus_value_parse(rows[i].text, &numbering, &v);
        assert_int_equal(good ? v.address : -1, rows[i].address);
    }
    struct modbus_numbering none;
    assert_false(modbus_numbering_parse("2", &none));
    assert_false(modbus_numbering_parse("40000", &none));
    assert_false(modbus_numbering_parse("4x", &none));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bits_beyond_the_value_are_not_its_own),
        cmocka_unit_test(a_whole_number_at_an_end_of_its_range_other_than_0_is_told),
        cmocka_unit_test(only_a_register_with_scale_offset_and_type_is_a_value),
        cmocka_unit_test(a_makers_number_is_the_address_after_its_first_one),
    };
    return cmocka_run_group_tests_name("modbus_value", tests, NULL, NULL);
}
