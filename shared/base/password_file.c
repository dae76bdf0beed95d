#include "base/password_file.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

enum result password_file_read(const char *path, const char *of, char *out, size_t size,
                               struct error *err) {
    FILE *file = fopen(path, "re");
    bool got = file && fgets(out, (int)size, file);
    if (file)
        fclose(file);
    if (!got)
        return fail(err, RESULT_MISSING, "%s: the password of %s: %s", path, of,
                    file ? "the first line is empty" : strerror(errno));
    out[strcspn(out, "\r\n")] = '\0';
    return RESULT_OK;
}
