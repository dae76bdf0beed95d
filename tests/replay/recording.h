// A played session on the arthrosis case, recorded in a folder of the test's own.
#pragma once

#include "scene/played.h"
#include "trace/trace.h"

#define RECORDED_ROWS 1200 // of the motion; the session has two steps more

extern struct played played;
extern char case_dir[96], trace_path[96];

int make_session(void **state);
int remove_session(void **state);

struct trace_header honest_header(void);

// Records the session anew. From step `from` on `change` may forge what is recorded; NULL: nothing.
// The session runs with the default settings, whatever the header says.
void record(const struct trace_header *header, uint64_t from,
            void (*change)(struct session_output *));
