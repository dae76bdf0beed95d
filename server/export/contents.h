// Selects the part of a trace to export, and passes over it.
#pragma once

#include "export/export.h"
#include "step/fields.h"

struct contents {
    struct trace_header header;
    uint64_t steps, jobs, landed; // steps, and those with a job and with one that landed
    int moves;                    // of a job, at most
    bool present[INSTRUMENT_COUNT];
    bool sampled[CHANNEL_COUNT][SAMPLE_KIND_COUNT];
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
int contents_fields(const struct contents *contents, struct step_field out_fields[STEP_FIELDS_MAX]);

// Two digits for each byte; out_text holds them and a zero.
void bytes_text(const uint8_t *bytes, size_t count, char *out_text);

// Passes over the steps that are exported, as often as wanted: what is appended meanwhile is not
// seen.
struct walk {
    const struct export_request *request;
    // Or NULL: the remarks between the steps that are exported.
    void (*remark)(void *user, const struct remark *remark);
    // Or NULL: the markers whose time is in the part that is exported.
    void (*marker)(void *user, const struct marker *marker);
    // Or NULL: the attempts that begin and end between the steps that are exported.
    void (*begun)(void *user, const struct trace_attempt *begun);
    void (*ended)(void *user, const struct trace_outcome *ended);
    struct trace_reader *reader; // of the pass that is on
    int pass, passes;            // of how many: set by the caller, for the progress
};

// False ends the pass.
typedef bool (*walk_step)(void *user, const struct trace_record *record, double seconds);

enum result walk_run(struct walk *walk, const struct contents *contents, walk_step step, void *user,
                     struct error *err);
