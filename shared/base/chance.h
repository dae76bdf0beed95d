// Random bytes for keys, codes and ids.
#pragma once

#include <stddef.h>

// Where the system gives none, the program ends in order (NEED).
void chance_fill(void *out, size_t size);
