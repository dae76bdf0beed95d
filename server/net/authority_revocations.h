// The authority's record of revoked certificates, in memory. What was read does not change: a new
// reading is a new object.
#pragma once

#include <stdbool.h>

struct revocations;

// Reads the record. NULL where `before`, read from the same folder, still holds; else release both.
// `before` NULL always reads. A record that is not there revokes nobody; one that is there and
// cannot be read revokes everyone, is logged, and is read again the next time.
struct revocations *revocations_read(const char *dir, const struct revocations *before);
void revocations_release(struct revocations **revocations);

bool revocations_contain(const struct revocations *revocations, const char *serial_hex);
