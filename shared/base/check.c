#include "base/check.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

_Noreturn void check_failed(const char *condition, const char *file, int line,
                            const char *function) {
    fprintf(stderr, "arthron: %s:%d: %s: check failed: %s\n", file, line, function, condition);
    abort();
}

static void *or_die(void *memory) {
    if (!memory) {
        fputs("arthron: out of memory\n", stderr);
        abort();
    }
    return memory;
}

void *alloc(unsigned long count, unsigned long size) {
    return or_die(calloc(count ? count : 1, size));
}

void *alloc_resize(void *memory, unsigned long count, unsigned long size) {
    return or_die(reallocarray(memory, count ? count : 1, size));
}

char *alloc_text(const char *text) {
    return or_die(strdup(text));
}
