// Types of fields: the size of a value in memory and in a trace, its range, and its text. For
// fields.c and for inputs.
#pragma once

#include <stddef.h>
#include <stdint.h>

struct field_type {
    size_t size;         // in memory
    size_t encoded;      // in a trace
    int64_t least, most; // range of a whole number, checked when it is read; both 0: any
    double (*number)(const void *value);
    void (*print)(const void *value, char *out_text); // into FIELD_TEXT_MAX
};

extern const struct field_type field_real, field_count, field_time, field_bits, field_hash,
    field_flag, field_state, field_events, field_validity, field_blade, field_job, field_mode,
    field_outcome, field_input, field_tissue, field_nearest, field_torn_count, field_move_count,
    field_loose, field_carrier;
