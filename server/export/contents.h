// What of a record is exported, and going through it.
#pragma once

#include "export/export.h"
#include "step/fields.h"

struct contents {
    struct trace_header header;
    uint64_t steps, jobs, landed; // steps, and those with a job and with one that landed
    int moves;                    // of a job, at most
    bool present[INSTRUMENT_COUNT];
    uint8_t hash[TRACE_HASH_SIZE]; // of the last whole record and, through it, of all before
    enum result end;               // RESULT_CLOSED: the record is whole
    struct error why;
};

// Reads the record once. RESULT_OK even where it is not whole, as out_contents->end then says.
enum result contents_read(const struct export_request *request, struct contents *out_contents,
                          struct error *err);

// RESULT_OK where it is whole, else what export.h says.
enum result contents_end(const struct contents *contents, struct error *err);

// The fields of all that was ever there. Returns how many.
int contents_fields(const struct contents *contents,
                    struct step_field out_fields[STEP_FIELDS_MAX]);

// Two digits for each byte; out_text holds them and a zero.
void bytes_text(const uint8_t *bytes, size_t count, char *out_text);

// From the first to the last step that is exported, as often as wanted: what is appended meanwhile
// is not seen.
struct walk {
    struct trace_reader *reader;
    const struct export_request *request;
    uint64_t left;
    int pass, passes; // of how many: set by the caller, for the progress
};

// Opens the record for its next pass.
enum result walk_begin(struct walk *walk, const struct contents *contents, struct error *err);
bool walk_next(struct walk *walk, struct trace_record *out_record, double *out_seconds);
void walk_end(struct walk *walk);
