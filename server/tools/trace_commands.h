// The commands of arthron-trace, one in each trace_NAME.c, and what they share.
#pragma once

#include "trace/trace.h"

#include <getopt.h>
#include <stdbool.h>
#include <stdint.h>

enum { EXIT_GOOD = 0, EXIT_FAULT = 1, EXIT_USAGE = 2 };

// argv[0] is the command. Each answers --help; returns the program's exit code.
int command_info(int argc, char **argv);
int command_verify(int argc, char **argv);
int command_replay(int argc, char **argv);
int command_cut(int argc, char **argv);
int command_export(int argc, char **argv);
int command_judge(int argc, char **argv);
int command_score(int argc, char **argv);
int command_serve(int argc, char **argv);
int command_picture(int argc, char **argv);
int command_report(int argc, char **argv);

// Takes one argument that is no option, FILE. EXIT_GOOD, or EXIT_USAGE after a line on stderr.
int take_file(int argc, char **argv, const char **out_file);

// The scene of the case that the trace names, or of case_dir where that is not NULL.
enum result load_scene(const struct trace_reader *reader, const char *case_dir,
                       struct scene **out_scene, struct error *err);

// The same, for what is in the case and not in the trace: without the case that the session was
// recorded with `what` is left out, which stderr says, and *out_scene is NULL. An error where
// case_dir names another one.
enum result load_scene_if_there(const char *command, const struct trace_reader *reader,
                                const char *case_dir, const char *what, struct scene **out_scene,
                                struct error *err);

// Seconds, 0 or more; false where the text is none.
bool take_seconds(const char *text, double *out_s);

int usage_error(const char *command, const char *format, ...) __attribute__((format(printf, 2, 3)));
int failed(const char *command, const struct error *err); // prints it; EXIT_FAULT
void wrote(const char *command, const char *path);        // says so on stderr

// A line on stderr that overwrites itself, where that is a terminal and at most a few times a
// second; `done` at `all` ends it.
void show_progress(uint64_t done, uint64_t all);
