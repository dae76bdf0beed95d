// The record of a session: an append-only binary file of inputs, outputs and step hashes.
//
// A file has a header, then records; trace/FORMAT.md describes every field. All numbers are
// little-endian. A record has a u32 with the size of its payload, a u8 with its type, the payload
// and a SHA-256. The SHA-256 is of the SHA-256 of the record before and of this record. So the
// records form a chain, and the last SHA-256 is signed. If a file ends within a record, the records
// before it can be read.
#pragma once

#include "base/attempt_words.h"
#include "base/marker.h"
#include "base/result.h"
#include "step/optic.h"
#include "step/session.h"
#include "trace/remark.h"

#define TRACE_VERSION 7
#define TRACE_OLDEST_VERSION 2    // the oldest that can be read
#define TRACE_OLDEST_RESUMED 4    // the oldest that a resumed session can be appended to
#define TRACE_FIRST_WITH_FAULTS 5 // the first with TRACE_FAULT, TRACE_TOUCH and TRACE_MARKER
#define TRACE_FIRST_WITH_ATTEMPTS 6
#define TRACE_FIRST_WITH_PARTS 7 // the first with TRACE_STATE and TRACE_TAKEN

#define TRACE_PARTS_MAX 65535

#define TRACE_HASH_SIZE 32
#define TRACE_CERTIFICATE_MAX 4096
#define TRACE_SIGNATURE_MAX 512

struct trace_header {
    uint16_t version; // set by the writer
    uint8_t session_id[16];
    uint8_t parent[TRACE_HASH_SIZE]; // the last hash of the trace that this was made from; 0: none
    uint8_t parent_id[16]; // that trace's session: this session, or the one that it is a copy of
    char station[64];
    char trainee[64];
    char case_name[CASE_NAME_MAX];
    char case_dir[256]; // on the server: an absolute path
    uint64_t case_hash;
    int64_t start_utc_ns;
    int64_t start_ns; // the server's monotonic clock at that moment
    struct session_settings settings;
    struct view_optic optic;
    int loose_count; // loose bodies of the case
    char build[64];  // SHA-1 of the compiled rooms that a step runs
    char libc[64];   // the C library, which has the mathematical functions
    char cpu[64];    // CPU level, as glibc names it
    // Which part of the session's trace this is. 1: the session began in it; from 2 on the trace
    // begins with a state (trace/part.h). Before version 7: 1.
    uint16_t part;
    char server[64]; // that wrote it, as its cluster names it; empty: it is in none
    uint64_t token;  // by which it had the station's sessions; rises from part to part; 0: none
};

// Fills build, libc and cpu with those of this process.
void trace_header_set_machine(struct trace_header *header);

// Whether the trace was cut out of another trace of the same session, and whether its session began
// as a copy of another session.
bool trace_header_is_piece(const struct trace_header *header);
bool trace_header_is_copied(const struct trace_header *header);

// ---- writing
//
// One thread calls trace_append, which copies into a buffer of 4 MB. It allocates nothing and never
// waits for a disk: another thread hashes and writes the buffers of all writers every 20 ms, and a
// third one calls fdatasync every second. Bytes stay in the buffer until fdatasync has succeeded.
// If it fails, they are written again.

struct trace_writer;

// Signs a trace that is closed. Must outlive the writer, which calls `sign` once, from another
// thread.
struct trace_signer {
    // Makes a signature with SHA-256, and gives the certificate (X.509, DER) of its key. If it
    // returns false, the trace stays unsigned.
    bool (*sign)(void *context, const uint8_t *message, size_t size, uint8_t *out_certificate,
                 size_t *in_out_certificate_size, uint8_t *out_signature,
                 size_t *in_out_signature_size);
    void *context;
};

struct trace_record;

// Learns what another server needs to go on with the session: each record that is no step, and each
// step that has a command, asks for a job, or lands one. Not the state of a later part, gaps,
// faults, restarts and the end. In order, once the bytes are in the file; a record may be on disk
// by then or not. Called from the threads that write, which wait for it. It must outlive the
// writer; so must what the record points to, only during the call.
struct trace_tap {
    void (*record)(void *user, const struct trace_record *record);
    void *user;
};

// Makes the file (it must not exist), writes the header and puts it on disk. `signer` and `tap` may
// be NULL. The header's part 0 counts as 1.
enum result trace_writer_create(const char *path, const struct trace_header *header,
                                const struct trace_signer *signer, const struct trace_tap *tap,
                                struct trace_writer **out_writer, struct error *err);

struct trace_place;

// Appends to a trace without an end record, and first adds a record that the session was resumed at
// utc_ns. Bytes after the last whole record are cut off. RESULT_REFUSED: another writer has the
// file.
enum result trace_writer_resume(const char *path, const struct trace_place *end, int64_t utc_ns,
                                const struct trace_signer *signer, const struct trace_tap *tap,
                                struct trace_writer **out_writer, struct error *err);

#define TRACE_TASK_NAME_MAX 32
#define TRACE_TASK_MAX 8192 // bytes of a task's file
#define TRACE_ATTEMPTS_MAX 100000

// An attempt at a task, and all that it is judged by. It begins with the next step.
struct trace_attempt {
    uint32_t number; // in the session, from 1
    enum attempt_purpose purpose;
    enum attempt_hand hand;
    char task[TRACE_TASK_NAME_MAX]; // the name of its file, without .ini
    // The pass mark. Version 0: the task file's.
    uint32_t mark_version;
    double pass_time_s;
    uint32_t pass_errors;
    uint32_t size; // of the task's file
    const char *text;
};

// As it was judged.
struct trace_outcome {
    uint32_t number;
    enum attempt_end end;
    enum verdict verdict;
    uint32_t goals_met, errors;
    uint64_t first_step, last_step; // that it was judged by; 0: it ended before any
    int64_t time_ns;                // that it took, without pauses
};

// Numbers in their ranges, a task's name, and a text of 1 to TRACE_TASK_MAX bytes.
bool trace_attempt_is_valid(const struct trace_attempt *attempt);
bool trace_outcome_is_valid(const struct trace_outcome *outcome);

// The caller appends every step, in order; before a step at which a job lands it writes the job's
// touch, if that is of offsets. False if the buffer is full: the step is counted as
// missing, and a gap record says so as soon as there is room.
bool trace_append(struct trace_writer *writer, const struct session_input *input,
                  const struct session_output *output);

// The same for a valid remark. False if the buffer is full: the trace lacks the remark.
bool trace_append_remark(struct trace_writer *writer, const struct remark *remark);

// The same for a valid marker, with its time on the session's clock. The writer must take markers:
// one that continues a trace of an older version does not.
bool trace_append_marker(struct trace_writer *writer, const struct marker *marker);
bool trace_takes_markers(const struct trace_writer *writer);

// The same for a valid attempt that begins with the next step, and for the end of the one that
// began last. The writer must take them: one that continues a trace of an older version does not.
bool trace_append_begun(struct trace_writer *writer, const struct trace_attempt *attempt);
bool trace_append_ended(struct trace_writer *writer, const struct trace_outcome *outcome);
bool trace_takes_attempts(const struct trace_writer *writer);

// How much the caller has appended so far, and whether so much would survive a loss of power.
uint64_t trace_position(const struct trace_writer *writer);
bool trace_is_on_disk(const struct trace_writer *writer, uint64_t position);

// The place behind a step whose append has left the caller at this position, but for its hash.
void trace_place_behind(const struct trace_writer *writer, uint64_t position,
                        const struct session_output *output, struct trace_place *out_place);

// Whether a writer of any process has the file.
bool trace_is_written(const char *path);

// Appends a record that was read from another trace: a step, a past input or a taken job with its
// touch, a part of a touch from a journal, a gap, a remark, a marker, the begin or the end of an
// attempt. Others are passed over. It waits for the disk, so a worker must not call it.
// RESULT_IO: the disk is full or has failed.
enum result trace_append_record(struct trace_writer *writer, const struct trace_record *record,
                                struct error *err);

struct trace_status {
    uint64_t records; // steps appended
    uint64_t missing; // steps dropped because the disk was too slow or full
    uint64_t bytes;   // written
    bool failing;     // the last attempt to write or sync failed
};

// From any thread.
struct trace_status trace_writer_status(const struct trace_writer *writer);

// For need_before_end (base/check.h): writes what all writers hold, with a bounded wait for their
// locks. From then on no step and no remark is taken, so that none is answered and lost: who
// appends waits for the program's end.
void trace_write_last(void);

// Writes the rest of the buffer and an end record, and closes the file. Waits for the disk. If the
// disk is full, the rest is lost, and the log says so. *writer becomes NULL; NULL inside is fine.
void trace_writer_destroy(struct trace_writer **writer);
// The same without an end record, so that the next server can resume the session in this trace.
void trace_writer_leave(struct trace_writer **writer);

// ---- reading

struct trace_reader;

enum trace_record_type {
    TRACE_STEP = 1,
    TRACE_GAP = 2,
    TRACE_END = 3,
    TRACE_PAST = 4,   // the input of a step before the first recorded one, without its output
    TRACE_RESUME = 5, // the server was started again here
    TRACE_REMARK = 6, // no input of the session
    TRACE_FAULT = 7,  // fdatasync failed here, and the bytes since the last success were rewritten
    TRACE_TOUCH = 8,  // part of what the next job to land changes of the touched surface
    TRACE_MARKER = 9, // no input of the session; its time may be before that of the step before it
    TRACE_BEGUN = 10, // an attempt begins with the next step: no input of the session
    TRACE_ENDED = 11, // the attempt that began last ended with the step before
    TRACE_STATE = 12, // part of the state from which a later part begins
    TRACE_TAKEN = 13  // a job that landed behind that state, in the trace of another server
};

struct trace_touch_part {
    uint64_t job;
    int tissue;
    uint32_t whole, offset, size; // bytes of all parts, of those before, and of this one
    const uint8_t *bytes;         // valid until the next record is read
};

struct trace_state_part {
    uint32_t whole, offset, size; // as of a touch
    const uint8_t *bytes;
};

struct trace_state;

struct trace_record {
    enum trace_record_type type;
    uint64_t offset; // of the record in the file
    uint64_t size;   // of the whole record
    // TRACE_STEP, TRACE_PAST; of INPUT_JOB without the result. TRACE_TAKEN: the landing's.
    struct session_input input;
    bool job_done;                // INPUT_JOB: whether there was a result
    struct session_output output; // TRACE_STEP; of TRACE_TAKEN the job, and how it landed
    uint64_t missing;     // TRACE_GAP: steps not recorded here; TRACE_END: in the whole session
    uint64_t records;     // TRACE_END: steps recorded
    int64_t utc_ns;       // TRACE_RESUME, TRACE_FAULT: when
    struct remark remark; // TRACE_REMARK
    struct marker marker; // TRACE_MARKER
    // TRACE_STEP, TRACE_PAST, TRACE_TAKEN of INPUT_JOB: what the job changed of the touched
    // surface, by offsets. NULL: nothing, or it is not recorded. Valid until the next record is
    // read.
    const struct touch_change *touch;
    int touch_tissue;
    struct trace_touch_part touch_part; // TRACE_TOUCH
    bool is_packed; // it came as bytes of a journal (trace/part.h): a touch in its parts alone
    struct trace_attempt begun; // TRACE_BEGUN; its text: valid until the next record is read
    struct trace_outcome ended; // TRACE_ENDED
    struct trace_state_part state_part; // TRACE_STATE
    // With the last part of the state: all of it (trace/state.h), valid until the next record is
    // read. Else NULL.
    const struct trace_state *state;
};

// Whether the record is of a step: recorded, past or taken over.
static inline bool record_is_input(const struct trace_record *record) {
    return record->type == TRACE_STEP || record->type == TRACE_PAST || record->type == TRACE_TAKEN;
}

// The place up to which a trace was read.
struct trace_place {
    uint64_t offset;  // in the file; the records before it are whole
    uint64_t step;    // number of the last step, with those in gaps and past ones
    uint64_t records; // recorded steps
    uint64_t missing; // steps in gaps
    uint64_t past;    // steps before and between that are not recorded here
    int64_t time_ns;  // of the last step
    unsigned version; // of the trace
    int rules;        // of its steps (step/settings.h)
    uint8_t hash[TRACE_HASH_SIZE];
};

// RESULT_IO: the file cannot be opened. RESULT_FORMAT: it is no trace. RESULT_VERSION: this program
// cannot read its version. RESULT_MISSING: it ends within the header. RESULT_CORRUPT: the header's
// checksum is wrong.
enum result trace_reader_create(const char *path, struct trace_reader **out_reader,
                                struct error *err);
void trace_reader_destroy(struct trace_reader **reader);
const struct trace_header *trace_reader_header(const struct trace_reader *reader);
struct trace_place trace_reader_place(const struct trace_reader *reader);
uint64_t trace_reader_offset(const struct trace_reader *reader); // bytes of whole records so far
uint64_t trace_reader_size(const struct trace_reader *reader);   // of the file when it was opened

// From the trace's beginning on, steps and touches before `to` are passed over: neither checked nor
// decoded, except those of attempts, which are judged by them. RESULT_REFUSED: the record before
// `to` is not the step with this hash of its output, or another hash ends it. RESULT_IO: the file
// cannot be read.
enum result trace_reader_skim(struct trace_reader *reader, const struct trace_place *to,
                              uint64_t output_hash, struct error *err);

// RESULT_OK: *out_record is the next record. RESULT_CLOSED: the end record was read.
// RESULT_MISSING: the file ends before it; the error names the byte. RESULT_CORRUPT: a checksum is
// wrong. RESULT_FORMAT: a value is out of range or contradicts the record before. After any result
// but RESULT_OK, further calls return the same result.
//
// A caller may give a step that was read to session_step: its frame is valid, its time is not
// negative and does not fall, and the header's settings are in range. Of a job's result a trace
// contains the touched surface alone, so a replay runs the jobs again (rerun.h). A touch comes
// before the step at which its job lands and has the hash that the step tells.
enum result trace_read(struct trace_reader *reader, struct trace_record *out_record,
                       struct error *err);

// After RESULT_CORRUPT or RESULT_FORMAT: continues at the first record after the damage whose hash
// continues the hash before it. *out_bytes is the number of bytes between. The records from there
// on are as they were written, but steps are missing before them. RESULT_MISSING: there is no such
// record. RESULT_IO: the file cannot be read.
enum result trace_skip_damage(struct trace_reader *reader, uint64_t *out_bytes, struct error *err);

// After RESULT_CORRUPT or RESULT_FORMAT: whether that is what a loss of power leaves of a trace
// that is being written: pages of zeros among the last 4 MB, and no end record. A writer can go on
// behind the records before. Any other damage is no torn end.
bool trace_ends_torn(struct trace_reader *reader);

// From now on a record with a tissue, a group or a torn ligament that the scene lacks is
// RESULT_FORMAT; so is the first record where the case has not as many loose bodies as the trace.
// The scene must be of the case on which the trace was recorded.
void trace_reader_bind(struct trace_reader *reader, const struct scene *scene);

// Whether a trace lacks its end record and is of a version that a server could still give one.
// Reads the header and the last 64 KB. One that is there and cannot be read counts as open.
bool trace_is_open(const char *path);

// The time of the last step, searched for from the end of the file. RESULT_MISSING: there is no
// step near the end, or the version is 2, which does not allow the search. RESULT_IO: the file
// cannot be read.
enum result trace_last_time(const char *path, int64_t *out_time_ns, struct error *err);

// ---- signatures

// The signed message: a text, the hash before the end record, and the numbers of recorded and
// missing steps.
#define TRACE_SEAL_SIZE (18 + TRACE_HASH_SIZE + 8 + 8)

struct trace_seal {
    uint8_t message[TRACE_SEAL_SIZE];
    size_t certificate_size, signature_size;
    const uint8_t *certificate, *signature;
};

// True if the end record was read and is signed. The seal is valid until the reader is destroyed.
bool trace_reader_seal(const struct trace_reader *reader, struct trace_seal *out_seal);

// Checks that the certificate's key made the signature, that the authority (a PEM file) issued the
// certificate, and that the certificate was valid at utc_ns. authority NULL: only the signature is
// checked. out_signed_by gets the certificate's name. RESULT_REFUSED: a check failed.
// RESULT_FORMAT: the certificate cannot be read. RESULT_IO: the authority's file cannot be read.
#define TRACE_SIGNED_BY_MAX 128
enum result trace_seal_check(const struct trace_seal *seal, const char *authority, int64_t utc_ns,
                             char out_signed_by[TRACE_SIGNED_BY_MAX], struct error *err);
