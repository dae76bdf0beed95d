// The input of a step as columns: what it was, when the frame was closed, and the samples by
// channel, each with its own time of measurement.
#pragma once

#include "step/fields.h"
#include "trace/trace.h"

struct input_row {
    enum input_kind kind;
    uint64_t job;    // INPUT_JOB: which is done,
    bool job_done;   // and that it has a result
    int64_t time_ns; // of the frame
    int device[CHANNEL_COUNT][SAMPLE_KIND_COUNT];
    bool sampled[CHANNEL_COUNT][SAMPLE_KIND_COUNT];
    struct sample samples[CHANNEL_COUNT][SAMPLE_KIND_COUNT];
};

#define INPUT_FIELDS_MAX 256

void input_row_of(const struct trace_record *record, struct input_row *out_row);

// Those of samples that `sampled` tells of. Offsets are in struct input_row. Returns how many.
int input_fields(const bool sampled[CHANNEL_COUNT][SAMPLE_KIND_COUNT],
                 struct step_field out_fields[INPUT_FIELDS_MAX]);

bool input_field_is_there(const struct step_field *field, const struct input_row *row);

// What is no measured value: for a table that has the outputs beside it.
bool input_field_is_time(const struct step_field *field);
