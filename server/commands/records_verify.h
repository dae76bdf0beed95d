// Whether the audit log of the records is as it was written.
#pragma once

#include "store/store.h"

#include <jansson.h>

// keys: the folder of the authority whose server signed the log; NULL: the signature is not
// checked. entry: "NUMBER:HASH" of an entry that the log must have; NULL: none. *out_said: what was
// found; the caller releases it, after an error too.
enum result records_verify(struct store *store, const char *keys, const char *entry,
                           json_t **out_said, struct error *err);
void records_verify_print(json_t *said);
