// Errors about the arguments of a program. Each function prints a line about the error and one
// about help to stderr. It returns 2, the exit code for wrong usage. `program` is "arthron-server
// records".
#pragma once

// After an error that getopt has printed.
int argument_help(const char *program);

int argument_wrong(const char *program, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

// `word` is none of the choices (ended by NULL) for `argument`, which is "--role" or "list". Names
// the nearest one, or all.
int argument_unknown(const char *program, const char *argument, const char *word,
                     const char *const *choices);
