// What the tests of traces share: a session of random steps, and files that hold it.
#pragma once

#include "folder.h"
#include "trace/trace.h"

extern char path[FOLDER_MAX + 16],
    copy_path[FOLDER_MAX + 16]; // two files in a folder of the test's own

int make_folder(void **state);
int remove_folder(void **state);

struct trace_header some_header(void);

// Step n of the random session, from 1: the same for the same n, and all kinds of values.
void step_at(uint64_t n, struct session_input *input, struct session_output *output);

struct trace_writer *start_writing(void); // a new file at `path`
bool append_step(struct trace_writer *writer, uint64_t n);
void write_trace(uint64_t steps); // the first steps, whole, at `path`

struct trace_reader *open_trace(const char *from);
void assert_is_step(const struct trace_record *record, uint64_t n);

struct outcome {
    enum result end;
    uint64_t steps;
    struct error err;
};

// Reads a file that may be damaged: fails where anything is accepted that is not the header and the
// first steps, in order.
struct outcome read_prefix_of_steps(const char *from);
