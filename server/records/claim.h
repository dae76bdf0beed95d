// What one server alone may use for as long as it lives: its records, and its folder of traces.
#pragma once

#include "base/result.h"

struct claim;

// Locks a file beside the records (RECORDS-server), and the folder of traces. records: empty where
// none are kept. RESULT_REFUSED where another server has one of them, or some program is writing a
// trace in the folder: the error says which. RESULT_IO: the lock cannot be made.
enum result claim_create(const char *records, const char *traces_dir, struct claim **out_claim,
                         struct error *err);
void claim_destroy(struct claim **claim); // NULL inside is fine
