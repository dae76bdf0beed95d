// What the fuzz targets share. A target is one file with LLVMFuzzerTestOneInput; libFuzzer drives
// it (tests/fuzz/run), and so does replay.c in every build. A CHECK that fails is a finding.
#pragma once

#include <stddef.h>
#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

// A folder of this process, in memory where it can be. It goes with the process unless that is
// killed.
const char *fuzz_folder(void);

// Writes a whole file in that folder and returns its path, which is good until the next call.
const char *fuzz_file(const char *name, const void *bytes, size_t size);

// The rest after the first byte `separator`, which may be empty; *out_first is the size before it.
const uint8_t *fuzz_split(const uint8_t *data, size_t size, uint8_t separator, size_t *out_first,
                          size_t *out_rest);
