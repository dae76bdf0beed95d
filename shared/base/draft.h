// A file that takes its place once it is whole: until then it lies beside it under another name,
// and what was there before stays.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

struct draft {
    FILE *file;
    char *path, *draft_path;
    int trouble; // errno of what failed first while it was written, else 0
};

// RESULT_MISSING where its folder is not there, RESULT_IO where it cannot be made.
enum result draft_open(const char *path, struct draft *out_draft, struct error *err);

// Remembers what went wrong, right after a write: errno holds until then. True where nothing did.
bool draft_is_good(struct draft *draft);

// Puts it in place, complete and on disk. Else the draft is removed, and the error says why.
enum result draft_keep(struct draft *draft, struct error *err);
void draft_drop(struct draft *draft);

// All of a file at once.
enum result draft_write(const char *path, const void *bytes, size_t size, struct error *err);
