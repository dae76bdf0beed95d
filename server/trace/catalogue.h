// The traces of a folder, by the names that the server gives them:
// STATION-20260102T030405Z-01234567.trace, with the start in UTC and the first digits of the
// session's id; a later part of the session ends with -p2.trace, -p3.trace, ...
#pragma once

#include "trace/trace.h"

#define TRACE_ID_TEXT_SIZE 33 // a session's id: 32 digits, and a zero
#define TRACE_NAME_MAX 128    // of a file
#define TRACE_STAMP "20260102T030405Z"

void trace_id_text(const uint8_t id[16], char out_text[TRACE_ID_TEXT_SIZE]);
bool trace_is_id(const char *text); // 32 digits, lower case

void trace_name(const struct trace_header *header, char out_name[TRACE_NAME_MAX]);

struct trace_entry {
    const char *path, *name; // the name is the path's end
    char station[64];
    char stamp[sizeof TRACE_STAMP]; // these sort as times do
    char id_start[9];
    int part;
    int64_t written_utc_ns; // time of the last write; INT64_MAX: it cannot be read
};

// Calls `entry` for each trace, in any order, until it returns false. Skips files with other names.
// RESULT_IO: the folder cannot be read.
enum result catalogue_each(const char *folder,
                           bool (*entry)(void *user, const struct trace_entry *entry), void *user,
                           struct error *err);

// Finds the trace of a session, of its parts the last one that is there: its header has the id, or
// its header cannot be read and its name has the id's start. RESULT_INVALID: `id` is no id.
// RESULT_MISSING: there is no such trace.
enum result catalogue_find(const char *folder, const char *id, char *out_path, size_t path_size,
                           struct error *err);

// Whether a file is the trace of a session, as above.
bool catalogue_is_of(const char *path, const char *id);
