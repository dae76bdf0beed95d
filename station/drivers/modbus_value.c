#include "drivers/modbus_value.h"

#include "base/number.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { VALUE_TEXT_MAX = 256, ADDRESS_MAX = 65535 };

const char *const modbus_order_names[] = {"ABCD", "CDAB", "BADC", "DCBA", NULL};

bool modbus_numbering_parse(const char *text, struct modbus_numbering *out) {
    static const struct modbus_numbering known[] = {
        {.first = 0},
        {.first = 1},
        {.first = 30001, .tells_input = true},
        {.first = 300001, .tells_input = true},
        {.first = 40001, .tells_holding = true},
        {.first = 400001, .tells_holding = true},
    };
    int64_t first;
    if (!number_int(text, 0, 400001, &first))
        return false;
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i].first == first) {
            *out = known[i];
            return true;
        }
    return false;
}

// "u17", "i32", "f32", "signed", "unsigned".
static bool parse_type(const char *word, struct modbus_value *v) {
    int64_t bits;
    if (!strcmp(word, "signed"))
        word = "i16";
    if (!strcmp(word, "unsigned"))
        word = "u16";
    if (!strchr("uif", word[0]) || !number_int(word + 1, word[0] == 'i' ? 2 : 1, 32, &bits) ||
        (word[0] == 'f' && bits != 32))
        return false;
    v->kind = word[0] == 'u' ? MODBUS_UNSIGNED : word[0] == 'i' ? MODBUS_SIGNED : MODBUS_FLOAT;
    v->bits = (int)bits;
    return true;
}

bool modbus_value_parse(const char *text, const struct modbus_numbering *numbering,
                        struct modbus_value *v) {
    char copy[VALUE_TEXT_MAX], *rest;
    double numbers[3] = {0, 1, 0};
    int count = 0;
    bool ended = false;
    if (snprintf(copy, sizeof copy, "%s", text) >= VALUE_TEXT_MAX)
        return false;
    for (char *word = strtok_r(copy, " \t", &rest); word; word = strtok_r(NULL, " \t", &rest)) {
        bool is_number = number_double(word, -1e9, 1e9, &numbers[count < 3 ? count : 2]);
        if (ended || (is_number && count == 3) || (!is_number && !parse_type(word, v)))
            return false;
        count += is_number;
        ended = !is_number;
    }
    double address = numbers[0] - numbering->first;
    if (!count || address != floor(address) || address < 0 ||
        address + modbus_value_words(v) - 1 > ADDRESS_MAX)
        return false;
    v->address = (int)address;
    v->scale = numbers[1];
    v->offset = numbers[2];
    return true;
}

int modbus_value_words(const struct modbus_value *v) {
    return v->bits > 16 ? 2 : 1;
}

uint16_t modbus_word(enum modbus_order order, uint16_t word) {
    bool exchanged = order == MODBUS_BADC || order == MODBUS_DCBA;
    return exchanged ? (uint16_t)(word << 8 | word >> 8) : word;
}

static uint32_t bits_of_words(const struct modbus_value *v, enum modbus_order order,
                              const uint16_t *words) {
    uint32_t first = modbus_word(order, words[0]);
    if (modbus_value_words(v) == 1)
        return first;
    uint32_t second = modbus_word(order, words[1]);
    bool low_first = order == MODBUS_CDAB || order == MODBUS_DCBA;
    return low_first ? second << 16 | first : first << 16 | second;
}

bool modbus_value_is_at_end(const struct modbus_value *v, enum modbus_order order,
                            const uint16_t *words) {
    uint32_t all = UINT32_MAX >> (32 - v->bits), bits = bits_of_words(v, order, words) & all;
    uint32_t lowest = all / 2 + 1; // of two's complement, as bits
    if (v->kind == MODBUS_FLOAT || v->bits < 8)
        return false;
    return v->kind == MODBUS_SIGNED ? bits == lowest || bits == lowest - 1 : bits == all;
}

double modbus_value_number(const struct modbus_value *v, enum modbus_order order,
                           const uint16_t *words) {
    uint32_t bits = bits_of_words(v, order, words);
    double raw;
    if (v->kind == MODBUS_FLOAT) {
        float number;
        memcpy(&number, &bits, sizeof number);
        raw = (double)number;
    } else {
        int64_t range = INT64_C(1) << v->bits, value = bits & (range - 1);
        raw = (double)(v->kind == MODBUS_SIGNED && value >= range / 2 ? value - range : value);
    }
    return v->scale * raw + v->offset;
}
