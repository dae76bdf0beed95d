#include "fuzz/fuzz.h"

#include "base/check.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char folder[256];

static void remove_folder(void) {
    DIR *directory = opendir(folder);
    if (!directory)
        return;
    for (const struct dirent *entry; (entry = readdir(directory));)
        if (entry->d_type == DT_REG)
            unlinkat(dirfd(directory), entry->d_name, 0);
    closedir(directory);
    rmdir(folder);
}

const char *fuzz_folder(void) {
    if (!*folder) {
        const char *parent = getenv("TMPDIR");
        snprintf(folder, sizeof folder, "%s/arthron-fuzz-XXXXXX", parent ? parent : "/dev/shm");
        CHECK(mkdtemp(folder));
        atexit(remove_folder);
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
