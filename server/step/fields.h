// Every field of a step's output, once: its bytes in traces and in the step's hash, their order,
// the version of the trace that has it first, and its name.
#pragma once

#include "base/bytes.h"
#include "step/output.h"

// ---- bytes --------------------------------------------------------------------------------------

// The fields but the hash, in the order of the table, little-endian. What is not there is told by
// its absence alone: an instrument by its flag, a job and a landing by the id 0, the move of a job
// that cuts nothing. `rules` as in session_settings: before rule 2 a job has one move.
void output_encode(struct writer *w, const struct session_output *output, int rules);

// The output must be zero. `version` of the trace that has the bytes: what it has not is taken as
// FORMAT.md says. False where a value is out of its range.
bool output_decode(struct reader *r, int version, int rules, struct session_output *out_output);

// XXH3 (64 bits) of the hash of the step before and of the encoded output.
uint64_t output_hash(uint64_t previous, const struct session_output *output, int rules);

// ---- names --------------------------------------------------------------------------------------

#define STEP_FIELDS_MAX 1024
#define FIELD_TEXT_MAX 80

// What a field belongs to: an instrument from 0, or one of these. Owners that are absent leave
// their fields 0.
enum field_owner {
    OWNER_STEP = -1,
    OWNER_JOB = -2,
    OWNER_CUT = -3, // a job that cuts
    OWNER_LANDED = -4,
    OWNER_MOVE = -5 // less i: move i of a job that cuts
};

struct step_field {
    char name[48]; // with its unit, as in motion files: "flexion_deg", "probe_tx_mm"
    int owner;
    int since;     // the version of the trace that has it first
    bool presence; // says whether that instrument is there
    size_t offset; // in struct session_output
    const struct field_type *type;
};

// Fills in the fields in the order of their bytes, the hash last, and returns how many there are.
int step_fields(struct step_field out_fields[STEP_FIELDS_MAX]);

// The part of an output that it is in: an instrument, OWNER_STEP, OWNER_JOB or OWNER_LANDED.
int step_field_part(const struct step_field *field);

// Whether what owns the field is there at this step.
bool step_field_is_there(const struct step_field *field, const struct session_output *output);

// The same bits? (NaN equals itself, 0 does not equal -0.)
bool step_field_equal(const struct step_field *field, const struct session_output *a,
                      const struct session_output *b);

// Of an output, or of what else the field's offset is in.
//
// Numbers so that reading them gives the same bits, names for states, validities and events.
void step_field_text(const struct step_field *field, const void *output,
                     char out_text[FIELD_TEXT_MAX]);

// The nearest double; of a state, a validity and the like its number.
double step_field_number(const struct step_field *field, const void *output);

// The value bit for bit, in the low bytes, and how many those are: 1, 4 or 8.
uint64_t step_field_bits(const struct step_field *field, const void *output);
size_t step_field_size(const struct step_field *field);
