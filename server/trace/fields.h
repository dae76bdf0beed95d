// Every field of a step's output by name: what a replay compares and what a table has as columns.
#pragma once

#include "session/session.h"

#define TRACE_FIELDS_MAX 256
#define TRACE_FIELD_TEXT_MAX 80

struct trace_field {
    char name[48];  // with its unit, as in motion files: "flexion_deg", "probe_tx_mm"
    int instrument; // whose it is, or -1
    bool presence;  // says whether that instrument is there; if not, its other fields are 0
    size_t offset;  // in struct session_output
    const struct trace_type *type;
};

// Fills in the fields and returns how many there are.
int trace_fields(struct trace_field out_fields[TRACE_FIELDS_MAX]);

// The same bits? (NaN equals itself, 0 does not equal -0.)
bool trace_field_equal(const struct trace_field *field, const struct session_output *a,
                       const struct session_output *b);

// Numbers so that reading them gives the same bits, names for states, validities and events.
void trace_field_text(const struct trace_field *field, const struct session_output *output,
                      char out_text[TRACE_FIELD_TEXT_MAX]);
