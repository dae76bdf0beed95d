// An expert's hands at a task on a case, as the server computed them: the newest are kept. One is
// computed at a time. From any thread that may wait for seconds.
#pragma once

#include "api/api.h"

struct rehearsals;

struct rehearsals *rehearsals_create(const struct api_config *config);
void rehearsals_destroy(struct rehearsals **rehearsals); // NULL inside is fine

// out_batch: a copy for the caller to free. RESULT_TIMEOUT: another one is being computed.
// RESULT_MISSING: there is none, because the hands cannot do it or it could not be computed.
enum result rehearsals_take(struct rehearsals *rehearsals, int task, int knee_case,
                            uint8_t **out_batch, size_t *out_size);
