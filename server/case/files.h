// Files of a case on the disk.
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "base/result.h"

// A whole regular file of at most max_bytes; the size is checked before anything is allocated. The
// caller frees *out_bytes. The error names the path.
enum result files_read(const char *path, size_t max_bytes, uint8_t **out_bytes, size_t *out_size,
                       struct error *err);

struct named_bytes {
    const char *name; // inside the folder
    const void *bytes;
    size_t size;
};

// Writes the files into dir, which is made with its parents where missing: first all of them,
// complete and synced, under other names, then each takes its place in the order given. After a
// failure none of the old files has changed, unless a rename itself failed.
enum result files_write(const char *dir, const struct named_bytes *files, int count,
                        struct error *err);

#ifdef __cplusplus
}
#endif
