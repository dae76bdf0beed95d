#include "fuzz/fuzz.h"

#include "base/check.h"
#include "folder.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char folder[FOLDER_MAX];

static void remove_own_folder(void) {
    folder_remove(folder);
}

const char *fuzz_folder(void) {
    if (!*folder) {
        folder_make_in_memory(folder);
        atexit(remove_own_folder);
    }
    return folder;
}

const char *fuzz_file(const char *name, const void *bytes, size_t size) {
    static char path[320];
    snprintf(path, sizeof path, "%s/%s", fuzz_folder(), name);
    FILE *file = fopen(path, "wbe");
    CHECK(file);
    CHECK(fwrite(bytes, 1, size, file) == size);
    CHECK(fclose(file) == 0);
    return path;
}

const uint8_t *fuzz_split(const uint8_t *data, size_t size, uint8_t separator, size_t *out_first,
                          size_t *out_rest) {
    const uint8_t *found = size ? memchr(data, separator, size) : NULL;
    *out_first = found ? (size_t)(found - data) : size;
    *out_rest = found ? size - *out_first - 1 : 0;
    return found ? found + 1 : data + size;
}
