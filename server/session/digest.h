// The hash of a step.
#pragma once

#include "session/session.h"

// XXH3 (64 bits) of the hash of the step before and of every field of the output but its own hash,
// in the order of the struct, little-endian, absent instruments by their absence alone.
uint64_t digest_output(uint64_t previous, const struct session_output *output);
