// The record of a session: an append-only binary file of inputs, outputs and step hashes.
//
// Layout (little-endian, written field by field; every field is in trace/FORMAT.md): a header, then
// records. A record is: u32 size of the payload, u8 type, payload, u64 XXH3 of all before it in the
// record. A file that ends in the middle of a record is read up to the last whole one.
#pragma once

#include "base/result.h"
#include "session/session.h"

#define TRACE_VERSION 3

struct trace_header {
    uint16_t version; // set by the writer
    uint8_t session_id[16];
    char station[64];
    char trainee[64];
    char case_name[CASE_NAME_MAX];
    char case_dir[256]; // where the server had it: an absolute path
    uint64_t case_hash;
    int64_t start_utc_ns;
    int64_t start_ns; // the server's monotonic clock at that moment
    struct session_settings settings;
    char build[64]; // SHA-1 of the compiled rooms whose code makes a step
    char libc[64];  // where its mathematics came from
    char cpu[64];   // CPU level, as glibc names it
};

// Fills build, libc and cpu with those of this process.
void trace_header_set_machine(struct trace_header *header);

// ---- writing
//
// One thread calls trace_append; a thread of the writer's own puts what came on disk every 20 ms
// and calls fdatasync every second, so appending never waits for a disk and allocates nothing.

struct trace_writer;

// Makes the file (it must not exist), writes the header and puts it on disk.
enum result trace_writer_create(const char *path, const struct trace_header *header,
                                struct trace_writer **out_writer, struct error *err);

// False where the writer's buffer is full: the step is counted as missing and a gap record says so
// as soon as there is room again. Steps are appended in order, none left out.
bool trace_append(struct trace_writer *writer, const struct session_input *input,
                  const struct session_output *output);

struct trace_status {
    uint64_t records; // steps appended
    uint64_t missing; // steps dropped because the disk was too slow or full
    uint64_t bytes;   // on disk
};

// From any thread.
struct trace_status trace_writer_status(const struct trace_writer *writer);

// Writes all that is left, an end record, and closes. *writer becomes NULL; NULL inside is fine.
// Waits for the disk. What a full disk does not take by then is lost, and logged.
void trace_writer_destroy(struct trace_writer **writer);

// ---- reading

struct trace_reader;

enum trace_record_type { TRACE_STEP = 1, TRACE_GAP = 2, TRACE_END = 3 };

struct trace_record {
    enum trace_record_type type;
    uint64_t offset;              // of the record in the file
    uint64_t size;                // of the whole record
    struct session_input input;   // TRACE_STEP; without a result
    bool job_done;                // INPUT_JOB: that it had a result
    struct session_output output; // TRACE_STEP
    uint64_t missing; // TRACE_GAP: steps not recorded here; TRACE_END: in the whole session
    uint64_t records; // TRACE_END: steps recorded
};

// RESULT_IO where it cannot be opened, RESULT_FORMAT where it is no trace, RESULT_VERSION where its
// version is not ours, RESULT_MISSING where it ends inside the header, RESULT_CORRUPT where the
// header's checksum is wrong.
enum result trace_reader_create(const char *path, struct trace_reader **out_reader,
                                struct error *err);
void trace_reader_destroy(struct trace_reader **reader);
const struct trace_header *trace_reader_header(const struct trace_reader *reader);
uint64_t trace_reader_offset(const struct trace_reader *reader); // bytes read and found whole
uint64_t trace_reader_size(const struct trace_reader *reader);   // of the file when it was opened

// RESULT_OK and a record; RESULT_CLOSED after the end record; RESULT_MISSING where the file ends
// before that (the error says at which byte); RESULT_CORRUPT where a checksum is wrong;
// RESULT_FORMAT where a record's content is out of range or does not follow from the one before.
// After anything but OK reading has ended, and the same is answered again.
//
// A step that was read may be given to session_step: its frame is valid, its time does not fall
// and is not below 0, and the header's settings are in range. The result of a job is not in the
// trace: whoever replays runs the job again (replay.c).
enum result trace_read(struct trace_reader *reader, struct trace_record *out_record,
                       struct error *err);
