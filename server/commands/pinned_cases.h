// Cases whose content the config names by its hash.
#pragma once

#include "sessions/config.h"

// Before the sessions are made: each such case has that content, or is fetched from another server
// ([cluster]). It may take minutes. RESULT_MISSING: nobody has it. The error names the case.
enum result pinned_cases_settle(const struct sessions_config *config, struct error *err);
