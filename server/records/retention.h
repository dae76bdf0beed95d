// Removes sessions that are older than they are kept, or that have no room any more: the oldest
// first, each with its trace, results and attempts, as somebody's request would. It never removes
// what store_dispensable leaves out, nor a session whose trace was asked for within an hour. Where
// the time of day jumped, or makes even the newest session too old, it waits for a day. The log
// tells what goes next, and the audit log what went.
#pragma once

#include <stdbool.h>
#include <stdint.h>

struct retention_config {
    const char *records, *traces_dir;
    int keep_days;                  // 0: no bound
    uint64_t keep_bytes;            // too
    int notice_s;                   // behind the start, in which it only tells
    bool (*may_remove)(void *user); // at two looks in a row; NULL: always
    void *user;
};

struct retention_figures {
    uint64_t removed;      // sessions
    int64_t due;           // those that go within a day, or once a tenth of keep_bytes came
    uint64_t traces_bytes; // of all files in the folder
};

struct retention;

// Starts a thread; texts are copied. Without a bound there is none: NULL.
struct retention *retention_start(const struct retention_config *config);
void retention_stop(struct retention **retention); // NULL inside is fine
struct retention_figures retention_figures(const struct retention *retention); // any thread

// Somebody reads this trace now.
void retention_asked(const char *trace);
