// Statements that wait for a learning record store, in a file that outlives the server: a statement
// a line. FILE.sent beside it says how far the store has them.
//
// A file of more than OUTBOX_TURN bytes becomes FILE.1 (and replaces it) when all of it is sent. Up
// to OUTBOX_MOST bytes it waits for that; then it takes no more.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>

#define OUTBOX_TURN ((size_t)64 << 20)
#define OUTBOX_MOST ((size_t)256 << 20)
#define OUTBOX_BATCH 50
#define OUTBOX_BATCH_BYTES ((size_t)512 << 10)
#define OUTBOX_LINE_MAX ((size_t)64 << 10)

struct outbox;

// Makes the file, for this user alone. Ends a line that was cut off as the last server ended. The
// caller closes it. sends: lines wait until outbox_sent; else nobody reads them here.
enum result outbox_open(const char *path, bool sends, struct outbox **out, struct error *err);
void outbox_close(struct outbox **outbox); // NULL inside is fine

// Adds a line, without its end, and brings it to the disk. Any thread. RESULT_LIMIT: it is longer
// than OUTBOX_LINE_MAX, or too many wait; RESULT_IO.
enum result outbox_add(struct outbox *outbox, const char *line, struct error *err);

// The next lines that were not sent, at most OUTBOX_BATCH, each ended by a 0.
struct outbox_batch {
    char *text; // OUTBOX_BATCH_BYTES
    int count;
    size_t starts[OUTBOX_BATCH + 1]; // in text; the last is the end of the last line
};

// One thread. RESULT_OK with a count of 0: nothing waits. RESULT_FORMAT: the file is none of ours.
enum result outbox_next(struct outbox *outbox, struct outbox_batch *batch, struct error *err);
// This many bytes from the first line that was not sent on: one line or more.
enum result outbox_sent(struct outbox *outbox, size_t bytes, struct error *err);
