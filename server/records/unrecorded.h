// The traces in a folder whose sessions have no end in the records.
#pragma once

#include "store/store.h"

#define RECORDER_ACTOR "server" // in the audit log

struct trace_paths {
    char (*at)[STORE_TEXT_MAX];
    size_t count, room;
};

// Marks sessions that began before start_utc_ns and are still open in the records as interrupted:
// their server has ended. Fills *out_paths in any case; trace_paths_fini. The records are open only
// while they are asked, not while traces are read.
enum result unrecorded_find(const char *records, const char *traces_dir, int64_t start_utc_ns,
                            struct trace_paths *out_paths, struct error *err);
void trace_paths_fini(struct trace_paths *paths);
