// The hash of a step.
#pragma once

#include "base/bytes.h"
#include "step/output.h"

// XXH3 (64 bits) of the hash of the step before and of every field of the output but its own hash,
// in the order of the struct, little-endian, absent instruments by their absence alone.
uint64_t digest_output(uint64_t previous, const struct session_output *output);

// The bytes of parts of an output, in hash and trace alike: their fields in the order of the
// struct, little-endian; of an absent instrument only that it is absent, of no job and nothing
// landed only the id 0, of a job that restores tissue no move, of a lead in the mode `tip` only
// that.
void digest_write_bones(struct writer *w, const struct session_output *output);
void digest_write_instrument(struct writer *w, const struct instrument_output *output);
void digest_write_job(struct writer *w, const struct job *job);
void digest_write_landed(struct writer *w, const struct landed *landed);
