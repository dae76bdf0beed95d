// What a session came to, in sentences: the verdict of each attempt, and what was cut.
#pragma once

#include "case/case.h"
#include "review/survey.h"

#include <stdio.h>

// knee: for the names of its tissues, or NULL.
void report_outcome(FILE *file, const struct survey *survey, const struct knee_case *knee);
