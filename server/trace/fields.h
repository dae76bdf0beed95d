// Every field of a step's output by name: what a replay compares and what a table has as columns.
#pragma once

#include "step/session.h"

#define TRACE_FIELDS_MAX 640
#define TRACE_FIELD_TEXT_MAX 80

enum trace_owner { OWNER_STEP = -1, OWNER_JOB = -2, OWNER_LANDED = -3 };

struct trace_field {
    char name[48]; // with its unit, as in motion files: "flexion_deg", "probe_tx_mm"
    int owner;     // an instrument, or enum trace_owner: where that is absent the field is 0
    int since;     // the version of the trace that has it first
    bool presence; // says whether that instrument is there
    size_t offset; // in struct session_output
    const struct trace_type *type;
};

// Fills in the fields and returns how many there are.
int trace_fields(struct trace_field out_fields[TRACE_FIELDS_MAX]);

// Whether what owns the field is there at this step.
bool trace_field_is_there(const struct trace_field *field, const struct session_output *output);

// The same bits? (NaN equals itself, 0 does not equal -0.)
bool trace_field_equal(const struct trace_field *field, const struct session_output *a,
                       const struct session_output *b);

// Numbers so that reading them gives the same bits, names for states, validities and events.
void trace_field_text(const struct trace_field *field, const struct session_output *output,
                      char out_text[TRACE_FIELD_TEXT_MAX]);

// The nearest double; of a state, a validity and the like its number.
double trace_field_number(const struct trace_field *field, const struct session_output *output);

// The value bit for bit, in the low bytes, and how many those are: 1, 4 or 8.
uint64_t trace_field_bits(const struct trace_field *field, const struct session_output *output);
size_t trace_field_size(const struct trace_field *field);
