// The mismatch of touch and sight as bytes: what a reader that knows PROTOCOL.md alone makes of it.
#include "wire/mismatch.h"

#include "random.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static void the_bytes_are_those_of_the_protocol(void **state) {
    (void)state;
    const double mm[] = {0, 0.02, 0, 0, -0.5, 0.009, -0.0101, 10};
    // 20 µm; +1 after one vertex; −25 after two; −1 after one; +500.
    static const uint8_t wanted[] = {20, 1, 2, 2, 49, 1, 1, 0, 0xe8, 0x07};
    uint8_t bytes[64];
    assert_int_equal(wire_mismatch_encode(mm, 8, bytes, sizeof bytes), sizeof wanted);
    assert_memory_equal(bytes, wanted, sizeof wanted);
    assert_int_equal(wire_mismatch_encode(mm, 1, bytes, sizeof bytes), 1); // nothing differs
}

static uint64_t varint(const uint8_t **at) {
    uint64_t value = 0;
    int shift = 0;
    do {
        value += (uint64_t)(**at & 127) << shift;
        shift += 7;
    } while (*(*at)++ & 128);
    return value;
}

static void any_values_come_back_within_half_a_step(void **state) {
    (void)state;
    enum { COUNT = 3000 };
    struct random r = {4};
    static double mm[COUNT], again[COUNT];
    for (int i = 0; i < COUNT; i++)
        mm[i] = random_bits(&r) % 3 ? 0 : random_between(&r, -1, 1) * WIRE_MISMATCH_MAX_MM;
    size_t bound = wire_mismatch_bound(COUNT);
    uint8_t *bytes = malloc(bound);
    size_t size = wire_mismatch_encode(mm, COUNT, bytes, bound);
    const uint8_t *at = bytes;
    double step = (double)varint(&at) / 1000;
    for (uint64_t next = 0; at < bytes + size; next++) {
        next += varint(&at);
        uint64_t code = varint(&at);
        assert_true(next < COUNT);
        again[next] = step * (code % 2 ? -(double)((code + 1) / 2) : (double)(code / 2));
    }
    for (int i = 0; i < COUNT; i++)
        assert_near(again[i], mm[i], step / 2 + 1e-9);
    free(bytes);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_bytes_are_those_of_the_protocol),
        cmocka_unit_test(any_values_come_back_within_half_a_step),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
