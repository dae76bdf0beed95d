// How far the touched surface lies from the seen one at each vertex of a mesh, as the bytes at the
// end of a payload (PROTOCOL.md, The mismatch).
#pragma once

#include <stddef.h>
#include <stdint.h>

#define WIRE_MISMATCH_STEP_MM 0.02
#define WIRE_MISMATCH_MAX_MM 1000.0

size_t wire_mismatch_bound(uint32_t count);

// mm: by the vertices' ids, within ±WIRE_MISMATCH_MAX_MM. Returns how many bytes it took.
size_t wire_mismatch_encode(const double *mm, uint32_t count, uint8_t *data, size_t size);
