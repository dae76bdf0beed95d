// What `arthron-station check` found: one line each, good or with what to do about it.
#pragma once

#include <stdbool.h>

#define FINDINGS_MAX 64

struct finding {
    bool good;
    char what[48];
    char text[400];
    const char *advice; // where it is not good
};

struct findings {
    int count;
    int faults; // of all, those dropped too
    struct finding items[FINDINGS_MAX];
};

// One too many is dropped, but counts where it is not good. `advice` is a literal.
void findings_add(struct findings *findings, bool good, const char *what, const char *advice,
                  const char *format, ...) __attribute__((format(printf, 5, 6)));

bool findings_are_good(const struct findings *findings);
void findings_print(const struct findings *findings, const char *station);
void findings_print_json(const struct findings *findings, const char *station);
