// The one table of all fields of a step's output: their bytes in traces and in the step's hash,
// their order, the first version of the trace that has them, and their names.
#pragma once

#include "base/bytes.h"
#include "step/output.h"

// ---- bytes --------------------------------------------------------------------------------------

// Writes all fields except the hash, in the order of the table, little-endian. Fields of an absent
// instrument, job or landing are left out, as are the moves of a job that does not cut. A flag
// marks an absent instrument, and the id 0 an absent job or landing. `rules` as in
// session_settings: before rule 2 a job has one move.
void output_encode(struct writer *writer, const struct session_output *output, int rules);

// *out_output must be zero. `version`: of the trace that has the bytes. `described`: instruments of
// its session, beside the usual ones. `loose`: loose bodies of its case. FORMAT.md says which
// values fields get that this version lacks. False if a value is out of its range.
bool output_decode(struct reader *reader, int version, int rules, int described, int loose,
                   struct session_output *out_output);

// The same for its job and what landed alone.
void output_encode_job(struct writer *writer, const struct session_output *output, int rules);
bool output_decode_job(struct reader *reader, int version, int rules,
                       struct session_output *out_output);

// XXH3 (64 bits) of the hash of the step before and of the encoded output.
uint64_t output_hash(uint64_t previous, const struct session_output *output, int rules);

// ---- names --------------------------------------------------------------------------------------

#define STEP_FIELDS_MAX 1408
#define FIELD_TEXT_MAX 112

// The owner of a field: an instrument from 0, or one of these. The fields of an absent owner are 0.
enum field_owner {
    OWNER_STEP = -1,
    OWNER_JOB = -2,
    OWNER_CUT = -3, // a job that cuts
    OWNER_LANDED = -4,
    OWNER_MOVE = -5,  // OWNER_MOVE - i: move i of a job that cuts
    OWNER_LOOSE = -64 // OWNER_LOOSE - i: loose body i
};

struct step_field {
    char name[48]; // with its unit, as in motion files: "flexion_deg", "probe_tx_mm"
    int owner;
    int since;     // the first version of the trace that has it
    bool presence; // its value says whether its instrument is present
    size_t offset; // in struct session_output
    const struct field_type *type;
};

// Fills in the fields in the order of their bytes, with the hash last, and returns their number.
int step_fields(struct step_field out_fields[STEP_FIELDS_MAX]);

// The part of an output that has the field: an instrument, OWNER_STEP, OWNER_JOB or OWNER_LANDED.
// Loose bodies are a part of the step.
int step_field_part(const struct step_field *field);

// Whether the field's owner is present in this output.
bool step_field_is_there(const struct step_field *field, const struct session_output *output);

// Whether both have the same bits: NaN equals itself, and 0 does not equal -0.
bool step_field_equal(const struct step_field *field, const struct session_output *a,
                      const struct session_output *b);

// `output`: the struct that the field's offset is in.
//
// Writes numbers so that reading them gives the same bits, and names for states, validities and
// events.
void step_field_text(const struct step_field *field, const void *output,
                     char out_text[FIELD_TEXT_MAX]);

// The nearest double; for a state, a validity or another enum its number.
double step_field_number(const struct step_field *field, const void *output);

// The bits of the value, in the low bytes; and the number of these bytes: 1, 4 or 8.
uint64_t step_field_bits(const struct step_field *field, const void *output);
size_t step_field_size(const struct step_field *field);
