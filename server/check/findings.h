// Findings from the figures of a check. For this room only.
#pragma once

#include "check/check.h"

// Adds to the findings that are there.
void findings_gather(struct case_check *check, const struct knee_case *knee);

void findings_grade(struct case_check *check); // by all of its findings
