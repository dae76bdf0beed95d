#include "igtl/sensor.h"

#include "base/check.h"
#include "igtl/big_endian.h"

#include <math.h>
#include <openigtlink/igtl_unit.h>
#include <stdio.h>
#include <string.h>

enum { HEADER = 10, UNITS = 6 };

enum result igtl_read_sensor(const struct igtl_content *c, struct igtl_sensor *out,
                             struct error *err) {
    if (c->size < HEADER || c->size != HEADER + 8 * (size_t)c->bytes[0])
        return fail(err, RESULT_FORMAT, "SENSOR with a content of %zu bytes", c->size);
    out->count = c->bytes[0];
    out->unit = big_endian_get(c->bytes + 2, 8);
    for (int i = 0; i < out->count; i++) {
        uint64_t bits = big_endian_get(c->bytes + HEADER + 8 * i, 8);
        memcpy(&out->values[i], &bits, sizeof bits);
    }
    return RESULT_OK;
}

size_t igtl_write_sensor(const struct igtl_sensor *sensor, uint8_t *out) {
    CHECK(sensor->count >= 0 && sensor->count <= IGTL_SENSOR_VALUES_MAX);
    uint8_t *at = big_endian_put(out, (uint64_t)sensor->count, 1);
    at = big_endian_put(at, 0, 1); // its status is reserved
    at = big_endian_put(at, sensor->unit, 8);
    for (int i = 0; i < sensor->count; i++) {
        uint64_t bits;
        memcpy(&bits, &sensor->values[i], sizeof bits);
        at = big_endian_put(at, bits, 8);
    }
    return (size_t)(at - out);
}

// ---- units --------------------------------------------------------------------------------------

// In grams, metres and seconds; `known`: of a force it may be a part.
static const struct unit {
    bool known;
    int gram, metre, second;
    double factor;
} parts[] = {
    [IGTL_UNIT_SI_BASE_METER] = {true, 0, 1, 0, 1},
    [IGTL_UNIT_SI_BASE_GRAM] = {true, 1, 0, 0, 1},
    [IGTL_UNIT_SI_BASE_SECOND] = {true, 0, 0, 1, 1},
    [IGTL_UNIT_SI_DERIVED_HERTZ] = {true, 0, 0, -1, 1},
    [IGTL_UNIT_SI_DERIVED_NEWTON] = {true, 1, 1, -2, 1000},
    [IGTL_UNIT_SI_DERIVED_PASCAL] = {true, 1, -1, -2, 1000},
    [IGTL_UNIT_SI_DERIVED_JOULE] = {true, 1, 2, -2, 1000},
    [IGTL_UNIT_SI_DERIVED_WATT] = {true, 1, 2, -3, 1000},
};

static double prefix_factor(int prefix) {
    static const double factors[16] = {1,   1e1,  1e2,  1e3,  1e6,  1e9,  1e12,  1e15,
                                       NAN, 1e-1, 1e-2, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15};
    return factors[prefix & 15];
}

// False: with something in it that is no part of a force.
static bool product_of(const igtl_unit_data *data, struct unit *out) {
    *out = (struct unit){.factor = prefix_factor(data->prefix)};
    for (int i = 0; i < UNITS; i++) {
        int unit = data->unit[i], power = data->exp[i];
        if (!unit || !power)
            continue;
        if ((size_t)unit >= sizeof parts / sizeof *parts || !parts[unit].known)
            return false;
        out->gram += power * parts[unit].gram;
        out->metre += power * parts[unit].metre;
        out->second += power * parts[unit].second;
        out->factor *= pow(parts[unit].factor, power);
    }
    return true;
}

// "mV", "kg m^2 s^-2"
static void write_unit(const igtl_unit_data *data, char *out, size_t size) {
    static const char *const prefixes[16] = {"",  "da", "h", "k", "M", "G", "T", "P",
                                             "?", "d",  "c", "m", "u", "n", "p", "f"};
    static const char *const symbols[] = {
        "",  "m", "g", "s", "A",   "K", "mol", "cd", "rad", "sr", "Hz", "N",  "Pa", "J",
        "W", "C", "V", "F", "ohm", "S", "Wb",  "T",  "H",   "lm", "lx", "Bq", "Gy", "Sv"};
    size_t used = (size_t)snprintf(out, size, "%s", prefixes[data->prefix & 15]);
    for (int i = 0; i < UNITS && used < size; i++) {
        int unit = data->unit[i], power = data->exp[i];
        bool known = (size_t)unit < sizeof symbols / sizeof *symbols;
        if (!unit)
            continue;
        used += (size_t)snprintf(out + used, size - used, "%s%s", i ? " " : "",
                                 known ? symbols[unit] : "?");
        if (power != 1 && used < size)
            used += (size_t)snprintf(out + used, size - used, "^%d", power);
    }
}

enum result igtl_unit_newtons(uint64_t unit, double *out_newtons, struct error *err) {
    igtl_unit_data data;
    struct unit product;
    char text[64];
    if (!unit)
        return fail(err, RESULT_INVALID, "it gives no unit");
    igtl_unit_unpack(unit, &data);
    if (!product_of(&data, &product) || product.gram != 1 || product.metre != 1 ||
        product.second != -2 || !isfinite(product.factor)) {
        write_unit(&data, text, sizeof text);
        return fail(err, RESULT_INVALID, "its unit %s is not one of force", text);
    }
    *out_newtons = product.factor / 1000;
    return RESULT_OK;
}
