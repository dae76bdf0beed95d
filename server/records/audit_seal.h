// Signs the end of the audit log (store), and the results of exams, with the server's key, as it
// signs traces. The hash of the last entry stands for all entries.
#pragma once

#include "store/store.h"
#include "trace/trace.h"

// RESULT_REFUSED: the signer has no key.
enum result audit_seal_make(const struct trace_signer *signer, const struct store_audit_head *head,
                            struct store_audit_seal *out_seal, struct error *err);

// As trace_seal_check. authority: a PEM file.
enum result audit_seal_check(const struct store_audit_seal *seal, const char *authority,
                             char out_signed_by[TRACE_SIGNED_BY_MAX], struct error *err);

// The same of an exam's result: entry is the exam's number, hash the SHA-256 of its text.
enum result exam_seal_make(const struct trace_signer *signer, const struct store_audit_head *head,
                           struct store_audit_seal *out_seal, struct error *err);
enum result exam_seal_check(const struct store_audit_seal *seal, const char *authority,
                            char out_signed_by[TRACE_SIGNED_BY_MAX], struct error *err);

// Signs the log unless it ends as it did when it was last signed, and keeps its last entry beside
// the keys (audit_head.h). *out_head: its last entry. Any error but RESULT_TIMEOUT and RESULT_IO:
// the log no longer has what was signed or kept, or the signature is wrong. Then it stays as it is,
// because a new signature would hide that.
enum result audit_seal_renew(struct store *store, const struct trace_signer *signer,
                             const char *authority, struct store_audit_head *out_head,
                             struct error *err);
