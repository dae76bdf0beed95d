// The authority's list of revoked certificates, in memory. A list never changes: reading again
// makes a new one.
#pragma once

#include <stdbool.h>

struct revocations;

// Reads the list. NULL if the file has not changed since `before` was read from the same folder;
// else release both. `before` NULL always reads. A missing file revokes no certificate. An
// unreadable file is logged, and is read again the next time. For a minute it is as if the file had
// not changed since a good `before`; else it revokes all certificates.
struct revocations *revocations_read(const char *dir, struct revocations *before);
void revocations_release(struct revocations **revocations);

bool revocations_contain(const struct revocations *revocations, const char *serial_hex);
