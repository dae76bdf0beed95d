// The last entry of the audit log that the server signed, kept beside its keys (audit.head).
// Whoever replaces the records, signature and all, does not have that file.
#pragma once

#include "store/store.h"

// "NUMBER:HASH". False if it is none.
bool audit_head_parse(const char *text, struct store_audit_head *out);

// authority: the PEM file in the folder of keys. RESULT_MISSING: none is kept there.
enum result audit_head_read(const char *authority, struct store_audit_head *out, struct error *err);
enum result audit_head_keep(const char *authority, const struct store_audit_head *head,
                            struct error *err);

// The log has the entry that is kept. *out is that entry, or zero where none is kept.
// RESULT_MISSING: it has not; the error says so and names the file.
enum result audit_head_check(struct store *store, const char *authority,
                             struct store_audit_head *out, struct error *err);
