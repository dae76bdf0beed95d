// The present grade of a case: check.json, read again when the file has changed.
#pragma once

#include "check/grade.h"

#include <sys/stat.h>

enum standing_kind {
    STANDING_UNCHECKED,  // there is no check.json
    STANDING_UNREADABLE, // `problem` says why
    STANDING_OUTDATED,   // it is of other files than the case's
    STANDING_FOREIGN,    // it was made elsewhere, and does not say that the case is unfit
    STANDING_GRADED,
};

struct case_standing {
    enum standing_kind kind;
    struct case_grade grade; // of STANDING_GRADED
    struct error problem;    // of STANDING_UNREADABLE
    // For standing_refresh only.
    bool looked;
    struct stat file;
};

// *standing must be zero before the first call. Each call does one stat. It reads the file only if
// it was made, replaced, changed or removed since the last call. True if it was read, and at the
// first call. dir and hash: of the case, the same in each call.
bool standing_refresh(struct case_standing *standing, const char *dir, uint64_t hash);

// "fit", "fit with warnings", "unfit" or "not checked".
const char *standing_name(const struct case_standing *standing);
