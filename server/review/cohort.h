// The figures of all sessions on a case, rising, to see one session's beside them.
#pragma once

#include "metrics/subject.h"
#include "store/store.h"

struct spread {
    char metric[STORE_NAME_MAX], subject[STORE_NAME_MAX], unit[16];
    int version;
    size_t first, count; // of the cohort's values
};

struct cohort {
    struct spread *spreads;
    size_t count, room;
    double *values;
    size_t value_count, value_room;
};

// As store_figures_on. RESULT_MISSING where there is no such course.
enum result cohort_read(struct store *store, const char *case_name, const char *course,
                        bool hide_few, struct cohort *out_cohort, struct error *err);
void cohort_fini(struct cohort *cohort); // a zeroed one is fine

// Those of the same kind, version and unit, about the same; NULL where there are none.
const struct spread *cohort_find(const struct cohort *cohort, const struct metric_kind *kind,
                                 const char *subject);
