// Reads a case in a process of its own before the server reads it.
#pragma once

#include "base/result.h"

#include <stdint.h>

// The memory of that process. Call it before read_case_check.
void read_case_limit(int memory_mb);

// A case_checker (case/case.h). It has read the whole case and made its scene.
enum result read_case_check(const char *dir, uint64_t *out_hash, struct error *err);
