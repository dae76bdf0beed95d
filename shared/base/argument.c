#include "base/argument.h"

#include "base/nearest.h"

#include <stdarg.h>
#include <stdio.h>

enum { EXIT_USAGE = 2 };

int argument_help(const char *program) {
    fprintf(stderr, "Try: %s --help\n", program);
    return EXIT_USAGE;
}

int argument_wrong(const char *program, const char *format, ...) {
    va_list args;
    fprintf(stderr, "%s: ", program);
    va_start(args, format);
    vfprintf(stderr, format, args);
    va_end(args);
    fputc('\n', stderr);
    return argument_help(program);
}

int argument_unknown(const char *program, const char *argument, const char *word,
                     const char *const *choices) {
    const char *meant = nearest_name(word, choices);
    fprintf(stderr, "%s: %s %s is unknown", program, argument, word);
    if (meant)
        fprintf(stderr, "; did you mean %s?", meant);
    else
        for (int i = 0; choices[i]; i++)
            fprintf(stderr, "%s%s", i ? ", " : "; the choices are ", choices[i]);
    fputc('\n', stderr);
    return argument_help(program);
}
