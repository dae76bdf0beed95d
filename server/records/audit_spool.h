// Audit entries that were not written before the server ended, in a file beside the records
// (RECORDS.arrears, for this user alone).
#pragma once

#include "store/store.h"

// Replaces the file by the entries that `next` gives, in order, until NULL: a line for each,
// "NANOSECONDS<tab>actor<tab>action<tab>subject". Takes no memory.
enum result audit_spool_write(const char *records,
                              const struct store_audit_entry *(*next)(void *user), void *user,
                              struct error *err);

// Calls `take` for each entry, and returns their number. Logs and leaves out a malformed line.
size_t audit_spool_read(const char *records,
                        void (*take)(void *user, const struct store_audit_entry *entry),
                        void *user);

void audit_spool_drop(const char *records); // after the entries were written
