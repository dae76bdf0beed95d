// Writes the report of a session: a page without other files (docs/METRICS.md has its figures).
#pragma once

#include "review/survey.h"
#include "store/store.h"

#include <stdio.h>

struct review_source {
    const char *trace;
    const char *case_dir; // for the names of groups; NULL: the one that the trace names
    // Instead of a folder: finds the case of this hash, or NULL. A server reads none that a trace
    // names.
    const struct knee_case *(*find_case)(void *user, uint64_t case_hash);
    void *user;
    survey_progress progress; // or NULL
    struct store
        *records;       // to draw the figures beside those on the same case; NULL: they stand alone
    const char *course; // only of its trainees; NULL: of all
    bool hide_few;      // as store_figures_on
};

// Whose session it is, the paths of the instruments' tips as measured and as seen, the warp and
// what may have been noticed of it, the joint, the resection, the figures. Reads the whole trace
// twice: some seconds for an hour. Of a trace that is not whole, what can be read. After an error
// nothing was written (RESULT_MISSING: there is no such course); an error of the file itself is the
// caller's to find.
//
// out_whole: the trace ends as it should, and no step is missing.
enum result review_write_page(const struct review_source *source, FILE *file, bool *out_whole,
                              struct error *err);

// The case that was recorded, in case_dir where that is not NULL, for the names of its groups. NULL
// and why where it is not there or is another one: its names would be wrong.
struct knee_case *review_case(const struct trace_header *header, const char *case_dir,
                              struct error *err);
