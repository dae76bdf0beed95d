// Looks for a finding of a check.
#pragma once

#include "check/check.h"

#include <string.h>

// The first of that level and place whose text holds `text`; NULL: none.
static inline const struct check_finding *find_finding(const struct case_check *check,
                                                       enum finding_level level, const char *where,
                                                       const char *text) {
    for (int i = 0; i < check->findings.count; i++) {
        const struct check_finding *f = &check->findings.findings[i];
        if (f->level == level && !strcmp(f->where, where) && strstr(f->text, text))
            return f;
    }
    return NULL;
}
