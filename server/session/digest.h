// The hash of a step.
#pragma once

#include "base/bytes.h"
#include "session/session.h"

// XXH3 (64 bits) of the hash of the step before and of every field of the output but its own hash,
// in the order of the struct, little-endian, absent instruments by their absence alone.
uint64_t digest_output(uint64_t previous, const struct session_output *output);

// The bytes of an instrument's output, in hash and trace alike: its fields in the order of the
// struct, little-endian; of an absent one only that it is absent.
void digest_write_instrument(struct writer *w, const struct instrument_output *output);
