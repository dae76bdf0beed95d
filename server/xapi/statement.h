// The xAPI statement of an attempt at a task: passed or failed.
#pragma once

#include "store/store.h"
#include "xapi/words.h"

// How people and things are named to outsiders.
struct xapi_naming {
    const char *site; // checked by xapi_check_site
    bool names;       // trainees by name; else as trainee-NUMBER, as in the audit log
};

// cells: a row of LIST_ATTEMPTS. courses: the names of the trainee's courses. NULL: there is none,
// because nobody is known to be the trainee, or it belongs to an exam that is not released. The
// caller releases it.
json_t *xapi_attempt(const struct store_cell *cells, int count, const json_t *courses,
                     const struct xapi_naming *naming);
