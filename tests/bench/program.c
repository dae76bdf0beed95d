#include "program.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static enum result beside_us(const char *program, char *out, size_t size, struct error *err) {
    ssize_t length = readlink("/proc/self/exe", out, size - 1);
    if (length < 0)
        return fail(err, RESULT_IO, "/proc/self/exe: %s", strerror(errno));
    out[length] = 0;
    char *name = strrchr(out, '/') + 1;
    snprintf(name, size - (size_t)(name - out), "%s", program);
    return access(out, X_OK) ? fail(err, RESULT_MISSING, "%s is not there: build it", out)
                             : RESULT_OK;
}

static void keep_to(int cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET((size_t)cpu, &set);
    sched_setaffinity(0, sizeof set, &set);
}

static void become(const char *path, const struct program *program, int out_fd) {
    int log =
        program->log ? open(program->log, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600) : -1;
    if (program->cpu >= 0)
        keep_to(program->cpu);
    if (log >= 0)
        dup2(log, STDERR_FILENO);
    if (out_fd >= 0)
        dup2(out_fd, STDOUT_FILENO);
    execv(path, (char *const *)program->words);
    _exit(127);
}

enum result program_start(const struct program *program, pid_t *out_pid, int *out_fd,
                          struct error *err) {
    char path[PATH_MAX];
    int pipes[2] = {-1, -1};
    enum result result = beside_us(program->words[0], path, sizeof path, err);
    if (result != RESULT_OK)
        return result;
    if (out_fd && pipe2(pipes, O_CLOEXEC))
        return fail(err, RESULT_IO, "pipe: %s", strerror(errno));
    *out_pid = fork();
    if (!*out_pid)
        become(path, program, pipes[1]);
    if (out_fd) {
        close(pipes[1]);
        *out_fd = pipes[0];
    }
    return RESULT_OK;
}
