// Puts what writers append on disk: one thread writes for all of them every 20 ms, another one
// calls fdatasync, so that a slow disk keeps no writer from writing. For writer.c only.
#pragma once

#include "trace/buffer.h"
#include "trace/chain.h"

#include <pthread.h>

struct trace_writer {
    int fd;
    char *path;
    unsigned version; // of the trace
    int rules;        // that the session follows
    struct buffer buffer;
    uint64_t offset; // in the file, of the buffer's first byte
    // The appender's.
    uint64_t gap; // steps dropped since the last record
    unsigned faults_told;
    struct chain chain; // through the records in the buffer
    const struct trace_signer *signer;
    // The appender's, for all to read.
    atomic_uint_fast64_t records, missing;
    // Of the threads. `writing` guards what is written and released. What is behind `synced` stays
    // in the buffer: after a failed fdatasync it is written again from there, for the pages may be
    // lost although they look clean.
    pthread_mutex_t writing;
    atomic_uint_fast64_t written, synced;
    atomic_bool rewrite, failing;
    atomic_uint faults; // failed calls of fdatasync
    atomic_int_fast64_t fault_utc_ns;
    int64_t synced_ns;
    // Under the lock of all writers.
    int holds;
    bool ends, ended;
    bool leaves; // without an end record
};

// From now on the threads have it too.
void disk_begin(struct trace_writer *writer);

// The appender has stopped. Returns once its end is on disk, or lost, and the threads have let go.
void disk_end(struct trace_writer *writer);

// It waits for room.
void disk_hurry(void);

// What an end record needs at the appender's side: writer.c.
void writer_put_end(struct trace_writer *writer);
