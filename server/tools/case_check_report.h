// The page of a check, for people.
#pragma once

#include "check/check.h"

// scene: NULL for a case that could not be prepared; the page then has no pictures. Replaces a file
// that is there. The error names the path.
enum result check_report(const struct case_check *check, const struct scene *scene,
                         const char *path, struct error *err);
