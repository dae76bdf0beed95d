// arthron-case: one function for each subcommand, called with its own name in argv[0]. Data go to
// stdout, everything else to stderr. They return the exit status.
#pragma once

#include "case/case.h"
#include "motion/motion.h"

#define EXIT_OK 0
#define EXIT_FAULT 1 // it failed, or found a fault
#define EXIT_USAGE 2

int command_cavity(int argc, char **argv);
int command_check(int argc, char **argv);
int command_deform(int argc, char **argv);
int command_generate(int argc, char **argv);
int command_import(int argc, char **argv);
int command_info(int argc, char **argv);
int command_landmarks(int argc, char **argv);
int command_ligament(int argc, char **argv);
int command_loose(int argc, char **argv);
int command_wear(int argc, char **argv);
int command_tissue(int argc, char **argv);
int command_maxcut(int argc, char **argv);
int command_motion(int argc, char **argv);
int command_picture(int argc, char **argv);
int command_plan(int argc, char **argv);
int command_read_surface(int argc, char **argv); // hidden: for command_import
int command_record_pose(int argc, char **argv);
int command_task(int argc, char **argv);
int command_tear(int argc, char **argv);

// Prints what is wrong and where help is; EXIT_USAGE.
int unknown_choice(const char *command, const char *argument, const char *word,
                   const char *const *choices);
int usage_error(const char *command, const char *format, ...) __attribute__((format(printf, 2, 3)));

// Prints the error's text; EXIT_FAULT.
int failed(const char *command, const struct error *err);

// `count` finite numbers separated by commas, and nothing else.
bool parse_numbers(const char *text, double *out_values, int count);

// Writes the motion's table; leaves no part of a file. RESULT_IO; the error names the path.
enum result write_motion(const struct motion *motion, const char *path, struct error *err);
