// For forgers: puts right the checksums of a trace of any version, header and whole records.
#pragma once

#include <stddef.h>
#include <stdint.h>

void trace_mend(uint8_t *data, size_t size);
