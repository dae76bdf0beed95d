// Arithmetic on several doubles at once: as many as the including file's LANES says, 2, 4 or 8, for
// a CPU level has registers of one width. What is told of a lane does not depend on LANES: the same
// bits.
#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define LANES_INLINE static inline __attribute__((always_inline))

typedef double lanes_t __attribute__((vector_size(LANES * sizeof(double))));
