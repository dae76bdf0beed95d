// Keeps a server's records and its folder of traces from other servers while it runs.
#pragma once

#include "base/result.h"

struct claim;

// Locks a file beside the records (RECORDS-server; none if `records` is empty), and the folder of
// traces. RESULT_REFUSED: another server uses one of them, or another program is writing a trace;
// the error names it. RESULT_IO: a lock cannot be made.
enum result claim_create(const char *records, const char *traces_dir, struct claim **out_claim,
                         struct error *err);
void claim_destroy(struct claim **claim); // NULL inside is fine
