// The record of a session: an append-only binary file of inputs, outputs and step hashes.
//
// Layout (little-endian, written field by field; docs in trace/FORMAT.md): a header, then records.
// A record is: u32 size of the payload, u8 type, payload, u64 XXH3 of type and payload. A file that
// ends in the middle of a record is read up to the last whole one.
#pragma once

#include "base/result.h"
#include "session/session.h"

#define TRACE_VERSION 1

struct trace_header {
    uint16_t version;
    uint8_t session_id[16];
    char station[64];
    char trainee[64];
    char case_name[CASE_NAME_MAX];
    char case_dir[256]; // where the server had it
    uint64_t case_hash;
    int64_t start_utc_ns;
    int64_t start_ns; // the server's monotonic clock at that moment
    struct session_settings settings;
    char build[64]; // build id of the server
    char libc[64];  // and what its mathematics came from
    char cpu[64];   // CPU level, as glibc names it
};

// Fills build, libc and cpu with those of this process.
void trace_header_set_machine(struct trace_header *header);

// ---- writing
// ------------------------------------------------------------------------------------- One thread
// calls trace_append; a thread of the writer's own puts what came on disk every 20 ms and calls
// fdatasync every second, so appending never waits for a disk.

struct trace_writer;

// Makes the file (it must not exist) and writes the header.
enum result trace_writer_create(const char *path, const struct trace_header *header,
                                struct trace_writer **out_writer, struct error *err);

// False where the writer's buffer is full: the record is counted as missing and a gap record says
// so as soon as there is room again.
bool trace_append(struct trace_writer *writer, const struct session_input *input,
                  const struct session_output *output);

struct trace_status {
    uint64_t records; // appended
    uint64_t missing; // dropped because the disk was too slow or full
    uint64_t bytes;   // on disk
};

struct trace_status trace_writer_status(const struct trace_writer *writer);

// Writes all that is left, an end record, and closes. *writer becomes NULL.
void trace_writer_destroy(struct trace_writer **writer);

// ---- reading
// -------------------------------------------------------------------------------------

struct trace_reader;

enum trace_record_type { TRACE_STEP = 1, TRACE_GAP = 2, TRACE_END = 3 };

struct trace_record {
    enum trace_record_type type;
    uint64_t offset;              // in the file
    struct session_input input;   // TRACE_STEP
    struct session_output output; // TRACE_STEP
    uint64_t missing;             // TRACE_GAP: steps that were not recorded
};

enum result trace_reader_create(const char *path, struct trace_reader **out_reader,
                                struct error *err);
const struct trace_header *trace_reader_header(const struct trace_reader *reader);

// RESULT_OK and a record; RESULT_CLOSED at the end of a whole file; RESULT_MISSING where the file
// ends inside a record (the error says at which byte); RESULT_CORRUPT where a checksum is wrong;
// RESULT_FORMAT where a record's content is out of range. After anything but OK reading has ended.
enum result trace_read(struct trace_reader *reader, struct trace_record *out_record,
                       struct error *err);
void trace_reader_destroy(struct trace_reader **reader);
