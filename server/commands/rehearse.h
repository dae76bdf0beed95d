// An expert's hands at a task, computed in a process of its own, for pages to show beside a
// trainee's.
#pragma once

#include "base/result.h"

#include <stddef.h>
#include <stdint.h>

struct rehearse_request {
    const char *task; // path of its file
    const char *dir;  // of the case
    const char *case_name;
    int memory_mb; // of that process
};

// An encoded LiveBatch, which the caller frees: the session, its moments, and the attempt. Takes
// seconds. RESULT_MISSING: the task cannot be done on the case. Any other error: it could not be
// computed.
enum result rehearse_apart(const struct rehearse_request *request, uint8_t **out_batch,
                           size_t *out_size, struct error *err);

// Ends what is being computed, with an error, and whatever would be from now on.
void rehearse_break_off(void);
