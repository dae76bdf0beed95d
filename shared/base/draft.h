// Writes a file under another name beside its place. Once it is whole, it takes its place. Until
// then the file that was there before stays.
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

// Call it right after a write: remembers errno if the write failed. True if it did not.
bool draft_is_good(struct draft *draft);

// Puts it in place, complete and on disk. Else the draft is removed, and the error says why.
enum result draft_keep(struct draft *draft, struct error *err);
void draft_drop(struct draft *draft);

// All of a file at once.
enum result draft_write(const char *path, const void *bytes, size_t size, struct error *err);
