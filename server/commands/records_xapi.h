// Sessions as xAPI 1.0.3 statements, for a learning record store (docs/RECORDS.md).
#pragma once

#include "store/store.h"

// A JSON array in a file of this user alone: a statement for each session that has ended and whose
// trainee is known. site: an http or https address without an end slash, under which the training
// centre's accounts, cases and extensions are named. out_left: sessions that are not among them.
enum result xapi_export(struct store *store, const char *path, const char *site, int *out_left,
                        struct error *err);
