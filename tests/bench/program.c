#include "program.h"

#include "base/check.h"
#include "base/clock.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define PATIENCE_NS (60 * NS_PER_S)
static const struct timespec look = {.tv_nsec = 10 * NS_PER_MS};

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
    bool is_ours = !strchr(program->words[0], '/');
    snprintf(path, sizeof path, "%s", program->words[0]);
    enum result result = is_ours ? beside_us(program->words[0], path, sizeof path, err) : RESULT_OK;
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

// ---- what it says -------------------------------------------------------------------------------

bool program_says(const char *log, const char *text) {
    char line[512];
    bool found = false;
    FILE *file = fopen(log, "r");
    while (file && !found && fgets(line, sizeof line, file))
        found = strstr(line, text) != NULL;
    if (file)
        fclose(file);
    return found;
}

enum result program_wait(pid_t pid, const char *log, const char *text, struct error *err) {
    int64_t end_ns = clock_now_ns() + PATIENCE_NS;
    while (!program_says(log, text)) {
        bool ended = waitpid(pid, NULL, WNOHANG) == pid;
        if (ended || clock_now_ns() > end_ns)
            return fail(err, RESULT_CLOSED, "%s: a program %s and did not say %s", log,
                        ended ? "ended" : "took a minute", text);
        nanosleep(&look, NULL);
    }
    return RESULT_OK;
}

void program_end(pid_t *pid, int signal_number) {
    if (*pid > 0) {
        kill(*pid, signal_number);
        waitpid(*pid, NULL, 0);
    }
    *pid = 0;
}

int program_port(void) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    int failed = fd < 0 || bind(fd, (struct sockaddr *)&address, size) ||
                 getsockname(fd, (struct sockaddr *)&address, &size);
    NEED(!failed, "port");
    close(fd);
    return ntohs(address.sin_port);
}
