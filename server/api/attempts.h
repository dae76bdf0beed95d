// Attempts as the principal may see them, for the files that answer about them.
#pragma once

#include "api/call.h"

// The attempt of the path, as ATTEMPT of docs/API.md with "figures" and "occurrences"; the caller
// releases it. NULL after a refusal: one that is another's is not there.
json_t *attempt_of_path(struct api_call *call, int64_t *out_number);

// The account, if it may be a rater; else NULL.
const char *attempt_rater(const struct api_call *call);

// Whether the principal must not learn whose session it is, as it rates an attempt of it. A refusal
// counts as such.
bool attempt_is_blind(struct api_call *call, const char *session);

// Whether the principal is the trainee of a session with an exam that was not released. A refusal
// counts as such.
bool attempt_is_withheld(struct api_call *call, const char *session);
