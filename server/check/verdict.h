// A check as JSON: grade, findings and all figures.
#pragma once

#include "check/check.h"

// One object, indented, as check.json has it. The caller frees it.
char *verdict_text(const struct case_check *check, int64_t utc_s);

// Puts it into the case's folder as check.json, which changes neither the case nor its hash, and
// notes that it was made here (grade.h). If it cannot be noted, it is there, but servers do not
// count it.
enum result verdict_save(const struct case_check *check, int64_t utc_s, const char *dir,
                         struct error *err);
