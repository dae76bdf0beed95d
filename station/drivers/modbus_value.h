// What the registers of a Modbus slave mean: where a value lies, and how its bits make a number. No
// line, no clock.
#pragma once

#include <stdbool.h>
#include <stdint.h>

// The first register as its maker counts it: 0 and 1, or with the digit that tells the kind of
// register, 3 for input registers and 4 for holding registers.
struct modbus_numbering {
    int first;        // 0, 1, 30001, 40001, 300001 or 400001
    bool tells_input; // 30001 and 300001
    bool tells_holding;
};

bool modbus_numbering_parse(const char *text, struct modbus_numbering *out);

// In which order a slave sends the bytes of a value of 32 bits, A the most significant one. In BADC
// and DCBA the bytes of a single register are exchanged, too.
enum modbus_order { MODBUS_ABCD, MODBUS_CDAB, MODBUS_BADC, MODBUS_DCBA, MODBUS_ORDER_COUNT };

extern const char *const modbus_order_names[]; // ended by NULL

enum modbus_kind { MODBUS_UNSIGNED, MODBUS_SIGNED, MODBUS_FLOAT };

struct modbus_value {
    int address; // as in a request, from 0
    enum modbus_kind kind;
    int bits; // 1 to 32; more than 16: two registers. Bits above them are not the value's
    double scale, offset;
};

// "REGISTER [SCALE [OFFSET]] [TYPE]": TYPE is u1 to u32, i2 to i32 (two's complement), f32,
// unsigned (u16) or signed (i16); without it kind and bits stay as they are. False: not of that
// form, or the register is none in this numbering.
bool modbus_value_parse(const char *text, const struct modbus_numbering *numbering,
                        struct modbus_value *value);

int modbus_value_words(const struct modbus_value *value); // 1 or 2 registers

// scale · what the registers say + offset; `words` begins with the value's first one.
double modbus_value_number(const struct modbus_value *value, enum modbus_order order,
                           const uint16_t *words);

// Whether a whole number is at an end of its range other than 0: what is measured may lie beyond,
// or the device has no value. Never of fewer than 8 bits.
bool modbus_value_is_at_end(const struct modbus_value *value, enum modbus_order order,
                            const uint16_t *words);

uint16_t modbus_word(enum modbus_order order, uint16_t word); // of one register
