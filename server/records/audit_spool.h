// Audit entries that the records did not take before the server ended: in a file beside them
// (RECORDS.arrears, this user's alone) until it is back.
#pragma once

#include "store/store.h"

// A line for each entry, "NANOSECONDS<tab>actor<tab>action<tab>subject". entries: of `count`, in
// order; what was in the file before gives way.
enum result audit_spool_write(const char *records, const struct store_audit_entry *entries,
                              size_t count, struct error *err);

// Gives each to `take`; returns how many. A line that is none is logged and left out.
size_t audit_spool_read(const char *records,
                        void (*take)(void *user, const struct store_audit_entry *entry),
                        void *user);

void audit_spool_drop(const char *records); // they are in the records now
