#include "base/output.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

int output_end(const char *program, int status) {
    errno = 0;
    if (!fflush(stdout) && !ferror(stdout))
        return status;
    fprintf(stderr, "%s: the output cannot be written%s%s\n", program, errno ? ": " : "",
            errno ? strerror(errno) : "");
    return status ? status : 1;
}
