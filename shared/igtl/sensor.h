// The content of a SENSOR: numbers of one unit.
#pragma once

#include "igtl/framing.h"

#include <stddef.h>
#include <stdint.h>

#define IGTL_SENSOR_VALUES_MAX 255

struct igtl_sensor {
    int count;
    uint64_t unit; // as the format packs it; 0: none is given
    double values[IGTL_SENSOR_VALUES_MAX];
};

#define IGTL_UNIT_NEWTON (UINT64_C(0x0b) << 54 | UINT64_C(1) << 50)

// RESULT_FORMAT: as many bytes as it should have numbers there are not.
enum result igtl_read_sensor(const struct igtl_content *content, struct igtl_sensor *out,
                             struct error *err);

// Returns the bytes that it wrote: 10, and 8 for each number.
size_t igtl_write_sensor(const struct igtl_sensor *sensor, uint8_t *out);

// How many newtons one of the unit is. RESULT_INVALID: it is no unit of force.
enum result igtl_unit_newtons(uint64_t unit, double *out_newtons, struct error *err);
