// A server keeps its records, and its folder of traces, for itself as long as it runs.
#pragma once

#include "base/result.h"

struct claim;

// Locks a file beside the records (RECORDS-server; records empty: none), and the folder of traces.
// RESULT_REFUSED names what another server uses, or a trace that another program is writing.
// RESULT_IO: a lock cannot be made.
enum result claim_create(const char *records, const char *traces_dir, struct claim **out_claim,
                         struct error *err);
void claim_destroy(struct claim **claim); // NULL inside is fine
