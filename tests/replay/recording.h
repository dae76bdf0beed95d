// A played session on the arthrosis case, recorded in a folder of the test's own.
#pragma once

#include "folder.h"
#include "scene/played.h"
#include "trace/trace.h"

extern struct played played;
extern char case_dir[FOLDER_MAX + 16], trace_path[FOLDER_MAX + 16];
extern uint64_t recorded_steps; // of the last session

int make_session(void **state);
int remove_session(void **state);

struct trace_header honest_header(void);

// Records the session anew. From step `from` on `change` may forge what is recorded; NULL: nothing.
// The session runs with the default settings, whatever the header says.
void record(const struct trace_header *header, uint64_t from,
            void (*change)(struct session_output *));
