// An expert's hands at a task on a case, as the server computed them: the newest are kept, for as
// long as the case has the same bytes. One is computed at a time, and one person makes the server
// compute only so often. From any thread that may wait for seconds.
#pragma once

#include "api/api.h"
#include "api/throttle.h"

struct rehearsals;

// What is asked for: places in the api's config.
struct rehearsal_wish {
    int task, knee_case;
    uint64_t case_hash; // as it is now
};

// The throttle must outlive it.
struct rehearsals *rehearsals_create(const struct api_config *config, struct throttle *throttle);
void rehearsals_destroy(struct rehearsals **rehearsals); // NULL inside is fine

// actor: who asks. out_batch: a copy for the caller to free. RESULT_TIMEOUT: another one is being
// computed. RESULT_LIMIT: the actor made the server compute too many; *out_wait_s is the time to
// wait. RESULT_MISSING: there is none, because the hands cannot do it or it could not be computed.
enum result rehearsals_take(struct rehearsals *rehearsals, const struct rehearsal_wish *wish,
                            const char *actor, uint8_t **out_batch, size_t *out_size,
                            int *out_wait_s);
