// The record of a session: an append-only binary file of inputs, outputs and step hashes.
//
// Layout (little-endian, written field by field; every field is in trace/FORMAT.md): a header, then
// records. A record is: u32 size of the payload, u8 type, payload, SHA-256 of that of the record
// before and of all before it in the record: a chain from the header to the end, whose last link is
// signed. A file that ends in the middle of a record is read up to the last whole one.
#pragma once

#include "base/result.h"
#include "step/optic.h"
#include "step/session.h"
#include "trace/remark.h"

#define TRACE_VERSION 5
#define TRACE_OLDEST_VERSION 2    // that is still read
#define TRACE_OLDEST_RESUMED 4    // whose records are written still, in its own trace
#define TRACE_FIRST_WITH_FAULTS 5 // that tells where the disk failed

#define TRACE_HASH_SIZE 32
#define TRACE_CERTIFICATE_MAX 4096
#define TRACE_SIGNATURE_MAX 512

struct trace_header {
    uint16_t version; // set by the writer
    uint8_t session_id[16];
    uint8_t parent[TRACE_HASH_SIZE]; // the last hash of the trace that this was made from; 0: none
    uint8_t parent_id[16];           // and its session: this one, or which this was copied from
    char station[64];
    char trainee[64];
    char case_name[CASE_NAME_MAX];
    char case_dir[256]; // where the server had it: an absolute path
    uint64_t case_hash;
    int64_t start_utc_ns;
    int64_t start_ns; // the server's monotonic clock at that moment
    struct session_settings settings;
    struct view_optic optic;
    char build[64]; // SHA-1 of the compiled rooms whose code makes a step
    char libc[64];  // where its mathematics came from
    char cpu[64];   // CPU level, as glibc names it
};

// Fills build, libc and cpu with those of this process.
void trace_header_set_machine(struct trace_header *header);

// A piece of a session's record; else it is a session's own, and perhaps copied from another one.
bool trace_header_is_piece(const struct trace_header *header);
bool trace_header_is_copied(const struct trace_header *header);

// ---- writing
//
// One thread calls trace_append. A thread for all writers writes what came every 20 ms, another one
// calls fdatasync every second, so appending never waits for a disk and allocates nothing. What
// fdatasync has not taken is kept, and is written again where that fails. At most 4 MB wait.

struct trace_writer;

// Who vouches for a trace that is closed. Outlives the writer, which calls `sign` once, from
// another thread.
struct trace_signer {
    // With SHA-256, and the certificate (X.509, DER) of the key. False where it cannot: the trace
    // stays unsigned.
    bool (*sign)(void *context, const uint8_t *message, size_t size, uint8_t *out_certificate,
                 size_t *in_out_certificate_size, uint8_t *out_signature,
                 size_t *in_out_signature_size);
    void *context;
};

// Makes the file (it must not exist), writes the header and puts it on disk. `signer` may be NULL.
enum result trace_writer_create(const char *path, const struct trace_header *header,
                                const struct trace_signer *signer, struct trace_writer **out_writer,
                                struct error *err);

struct trace_place;

// Goes on after the last whole record of a trace that has no end: what is there behind it is cut
// off, and a record says that the session was resumed at utc_ns. RESULT_REFUSED where a writer is
// still at work on it.
enum result trace_writer_resume(const char *path, const struct trace_place *end, int64_t utc_ns,
                                const struct trace_signer *signer, struct trace_writer **out_writer,
                                struct error *err);

// False where the writer's buffer is full: the step is counted as missing and a gap record says so
// as soon as there is room again. Steps are appended in order, none left out.
bool trace_append(struct trace_writer *writer, const struct session_input *input,
                  const struct session_output *output);

// What was said at this place; valid, and by the thread that appends. False where the buffer is
// full: it is not in the trace then.
bool trace_append_remark(struct trace_writer *writer, const struct remark *remark);

// Whether a writer is at work on the file, in any process.
bool trace_is_written(const char *path);

struct trace_record;

// A record as it was read, to make a trace of another: a step, a gap, an input alone, a remark.
// Waits for the disk, so not for a worker. RESULT_IO where the disk takes no more.
enum result trace_append_record(struct trace_writer *writer, const struct trace_record *record,
                                struct error *err);

struct trace_status {
    uint64_t records; // steps appended
    uint64_t missing; // steps dropped because the disk was too slow or full
    uint64_t bytes;   // written
    bool failing;     // the disk does not take what it is given
};

// From any thread.
struct trace_status trace_writer_status(const struct trace_writer *writer);

// Writes all that is left, an end record, and closes. *writer becomes NULL; NULL inside is fine.
// Waits for the disk. What a full disk does not take by then is lost, and logged.
void trace_writer_destroy(struct trace_writer **writer);
// The same without an end record: the next server goes on with the session in this trace.
void trace_writer_leave(struct trace_writer **writer);

// ---- reading

struct trace_reader;

enum trace_record_type {
    TRACE_STEP = 1,
    TRACE_GAP = 2,
    TRACE_END = 3,
    TRACE_PAST = 4,   // a step's input without its output: what led to where a piece begins
    TRACE_RESUME = 5, // here the server was started again
    TRACE_REMARK = 6, // nothing that the session learnt
    TRACE_FAULT = 7   // the disk failed: what it had not taken for sure was written again
};

struct trace_record {
    enum trace_record_type type;
    uint64_t offset;              // of the record in the file
    uint64_t size;                // of the whole record
    struct session_input input;   // TRACE_STEP, TRACE_PAST; without a result
    bool job_done;                // INPUT_JOB: that it had a result
    struct session_output output; // TRACE_STEP
    uint64_t missing;     // TRACE_GAP: steps not recorded here; TRACE_END: in the whole session
    uint64_t records;     // TRACE_END: steps recorded
    int64_t utc_ns;       // TRACE_RESUME, TRACE_FAULT: when
    struct remark remark; // TRACE_REMARK
};

// How far a trace was read.
struct trace_place {
    uint64_t offset;  // in the file: all before it is whole
    uint64_t step;    // the last, gaps and past counted
    uint64_t records; // steps recorded
    uint64_t missing; // in gaps
    uint64_t past;    // inputs alone
    int64_t time_ns;  // of the last step
    unsigned version; // of the trace
    int rules;        // that its steps follow
    uint8_t hash[TRACE_HASH_SIZE];
};

// RESULT_IO where it cannot be opened, RESULT_FORMAT where it is no trace, RESULT_VERSION where its
// version is not ours, RESULT_MISSING where it ends inside the header, RESULT_CORRUPT where the
// header's checksum is wrong.
enum result trace_reader_create(const char *path, struct trace_reader **out_reader,
                                struct error *err);
void trace_reader_destroy(struct trace_reader **reader);
const struct trace_header *trace_reader_header(const struct trace_reader *reader);
struct trace_place trace_reader_place(const struct trace_reader *reader);
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

// After RESULT_CORRUPT or RESULT_FORMAT: goes on at the first record behind the damage that follows
// from the hash before it, and tells how many bytes are left out. RESULT_MISSING where there is
// none. What is read from then on is as it was written, but steps are missing before it.
enum result trace_skip_damage(struct trace_reader *reader, uint64_t *out_bytes, struct error *err);

// From now on a record that names a tissue, a group or a torn ligament which the scene does not
// have is RESULT_FORMAT. The scene is that of the case which the trace was recorded with.
void trace_reader_bind(struct trace_reader *reader, const struct scene *scene);

// The time of the last step that a trace has, found from its end. RESULT_MISSING where none is near
// it, or the version is 2, whose records do not tell where they begin.
enum result trace_last_time(const char *path, int64_t *out_time_ns, struct error *err);

// ---- who vouches for it

// What a signer signs: a text, the hash before the end record, and its counts of steps and of
// missing ones.
#define TRACE_SEAL_SIZE (18 + TRACE_HASH_SIZE + 8 + 8)

struct trace_seal {
    uint8_t message[TRACE_SEAL_SIZE];
    size_t certificate_size, signature_size;
    const uint8_t *certificate, *signature;
};

// True after the end record where that is signed. The seal holds until the reader is destroyed.
bool trace_reader_seal(const struct trace_reader *reader, struct trace_seal *out_seal);

// Whether the seal's signature is that of its certificate, and the certificate one that the
// authority (a PEM file; NULL: not asked) gave and that was good at utc_ns. Says whose certificate
// it is. RESULT_REFUSED where not, RESULT_FORMAT where it is no certificate, RESULT_IO where the
// authority's cannot be read.
#define TRACE_SIGNED_BY_MAX 128
enum result trace_seal_check(const struct trace_seal *seal, const char *authority, int64_t utc_ns,
                             char out_signed_by[TRACE_SIGNED_BY_MAX], struct error *err);
