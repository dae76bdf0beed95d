// Writes the buffers of all writers to disk: one thread writes every 20 ms, and another one calls
// fdatasync, so that a slow fdatasync delays no write. For writer.c only.
#pragma once

#include "trace/buffer.h"
#include "trace/chain.h"
#include "trace/record.h"

#include <pthread.h>

// Steps that the tap learns of, from the appender to the threads: the positions of their records.
#define NOTES 256
struct notes {
    uint64_t at[NOTES];
    atomic_uint_fast64_t head; // the appender's
    atomic_uint_fast64_t tail; // the threads'
    atomic_uint_fast64_t lost; // there was no room for a step before this position
};

struct trace_writer {
    int fd;
    char *path;
    unsigned version; // of the trace
    int rules;        // of the session
    struct buffer buffer;
    uint64_t offset; // in the file, of the buffer's first byte
    // For the appender:
    uint64_t gap; // steps dropped since the last record
    unsigned faults_told;
    const struct trace_signer *signer;
    const struct trace_tap *tap; // NULL: none
    struct trace_layout layout;  // of its records, for the tap
    struct notes notes;
    // The appender writes these, any thread reads them:
    atomic_uint_fast64_t records, missing;
    // For the two threads. `writing` guards the file, the chain and the release of bytes. Records
    // are appended without their hashes; up to `sealed` they have them. Bytes after `synced` stay
    // in the buffer and are written again after a failed fdatasync: the kernel may have marked
    // their pages as clean and lost them.
    pthread_mutex_t writing;
    struct chain chain;
    uint64_t sealed;
    uint64_t tapped; // up to there the tap was told
    atomic_uint_fast64_t written, synced;
    atomic_bool rewrite, failing;
    atomic_uint_fast64_t failed_head; // what had been appended when the disk failed last
    atomic_uint faults;               // failed calls of fdatasync
    atomic_int_fast64_t fault_utc_ns;
    int64_t synced_ns;
    int64_t finish_ns; // when its end was first tried; 0: not yet
    bool end_put;      // into the buffer
    // Under the lock of all writers:
    int holds;
    bool ends, ended;
    bool leaves; // without an end record
};

// Hands the writer to the threads. False: the system gives no thread.
bool disk_begin(struct trace_writer *writer);

// Call it after the last append. Returns once the end is on disk or lost, and the threads no longer
// use the writer.
void disk_end(struct trace_writer *writer);

// The program is about to end (trace_write_last).
extern atomic_bool disk_ends;

// Writes now, because an appender waits for room.
void disk_hurry(void);

// Gives all records in the buffer their hashes; under `writing` (writer.c).
void writer_seal(struct trace_writer *writer);
// Tells the tap what has been written; too.
void writer_tap(struct trace_writer *writer);
// Appends a part of the state of a new part (part.c). RESULT_IO: the disk is full or has failed.
enum result writer_append_state(struct trace_writer *writer, const struct trace_state_part *part,
                                struct error *err);
// Appends the end record.
void writer_put_end(struct trace_writer *writer);
