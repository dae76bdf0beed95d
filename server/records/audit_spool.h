// Audit entries that were not written before the server ended, in a file beside the records
// (RECORDS.arrears, for this user alone).
#pragma once

#include "store/store.h"

// Replaces the file by the entries that `next` gives, in order, until NULL: a line for each,
// "NANOSECONDS<tab>actor<tab>action<tab>subject". Takes no memory.
enum result audit_spool_write(const char *records,
                              const struct store_audit_entry *(*next)(void *user), void *user,
                              struct error *err);
// The same behind the entries that the file has.
enum result audit_spool_add(const char *records,
                            const struct store_audit_entry *(*next)(void *user), void *user,
                            struct error *err);

// Calls `take` for each entry, and gives their number. Logs and leaves out a malformed line.
// RESULT_IO: the file cannot be read, or was read in part; nothing may replace it.
enum result audit_spool_read(const char *records,
                             void (*take)(void *user, const struct store_audit_entry *entry),
                             void *user, size_t *out_count, struct error *err);

void audit_spool_drop(const char *records); // after the entries were written
