// What is wrong with the arguments of a program. Each prints one line to stderr and where to find
// help, and returns 2, the exit code for wrong usage. `program` is "arthron-server records".
#pragma once

// For what getopt has named already.
int argument_help(const char *program);

int argument_wrong(const char *program, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

// `word` is none of the choices (ended by NULL) for `argument`, which is "--role" or "list". Names
// the nearest one, or all.
int argument_unknown(const char *program, const char *argument, const char *word,
                     const char *const *choices);
