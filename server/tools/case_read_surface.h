// Reads a file of a scan in a process of its own: its readers are other people's, and so is the
// file.
#pragma once

#include "import/import.h"

// As import_read. RESULT_LIMIT: also where the other process needs too much memory or time.
enum result read_surface_apart(const char *path, struct import_arrays *out_arrays,
                               struct error *err);
