#include "replay/program.h"

#include "test.h"

#include <stdio.h>
#include <sys/wait.h>

int run_program(const char *program, const char *arguments, char *out, size_t size) {
    char line[1024];
    int length = snprintf(line, sizeof line, "%s %s 2>&1", program, arguments);
    assert_in_range(length, 0, sizeof line - 1);
    FILE *pipe = popen(line, "r");
    assert_non_null(pipe);
    out[fread(out, 1, size - 1, pipe)] = '\0';
    int status = pclose(pipe);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}
