// All attempts of a course's trainees for researchers: one zip of tables (CSV, RFC 4180, UTF-8)
// with a codebook that describes each column. docs/RECORDS.md tells of it.
#pragma once

#include "store/store.h"

#include <stdio.h>

struct study_request {
    const char *course;
    const char *task;               // NULL: all
    int64_t from_utc_ns, to_utc_ns; // of the beginning of an attempt; to: without; 0: no bound
    bool names; // trainees and raters by name; else trainee-NUMBER, rater-NUMBER
};

// Writes the zip behind what `file` has. Leaves out attempts of exams that are not released.
// RESULT_MISSING: there is no such course.
enum result study_write(struct store *store, const struct study_request *request, FILE *file,
                        struct error *err);
