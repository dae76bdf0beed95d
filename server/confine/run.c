#include "base/check.h"
#include "base/clock.h"
#include "confine/confine.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#define END_MS 500
#define LOOK_MS 200 // between two looks whether it is cancelled
#define BUSY 10     // a machine on which others compute gives so much less processor time

extern char **environ;

struct child {
    pid_t pid;
    int from; // its standard output
    int64_t until_ns;
    const atomic_bool *cancelled;
};

static enum result start(const char *const arguments[], const struct confine_limits *limits,
                         struct child *out, struct error *err) {
    int ends[2];
    sigset_t none, usual;
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    if (pipe2(ends, O_CLOEXEC))
        return fail(err, RESULT_IO, "a reader cannot be started: %s", strerror(errno));
    sigemptyset(&none);
    sigfillset(&usual);
    posix_spawn_file_actions_init(&actions);
    int failed = posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &usual);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    if (!failed)
        failed = posix_spawn(&out->pid, "/proc/self/exe", &actions, &attributes,
                             (char *const *)arguments, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    out->from = ends[0];
    out->cancelled = limits->cancelled;
    out->until_ns = clock_now_ns() + (int64_t)limits->cpu_s * BUSY * NS_PER_S;
    if (!failed)
        return RESULT_OK;
    close(ends[0]);
    return fail(err, RESULT_IO, "a reader cannot be started: %s", strerror(failed));
}

// False: it took too long, or is cancelled.
static bool wait_for_bytes(const struct child *child) {
    struct pollfd from = {.fd = child->from, .events = POLLIN};
    int ready = 0;
    while (ready <= 0 && clock_now_ns() < child->until_ns &&
           !(child->cancelled && atomic_load(child->cancelled))) {
        ready = poll(&from, 1, LOOK_MS);
        if (ready < 0 && errno != EINTR)
            return false;
    }
    return ready > 0;
}

// All that it says, at most size_max bytes and one.
static size_t listen_to(const struct child *child, size_t size_max, uint8_t **out) {
    size_t used = 0, room = 0;
    ssize_t got = 1;
    *out = NULL;
    while (got > 0 && used <= size_max && wait_for_bytes(child)) {
        if (used == room) {
            room = 2 * room + 4096;
            *out = alloc_resize(*out, room, 1);
        }
        got = read(child->from, *out + used, room - used);
        if (got < 0 && errno == EINTR)
            got = 1;
        else if (got > 0)
            used += (size_t)got;
    }
    if (got != 0)
        kill(child->pid, SIGKILL);
    return used;
}

// 0: it runs, or a signal interrupted.
static pid_t wait_for(const struct child *child, int *out_status, int flags) {
    pid_t ended = waitpid(child->pid, out_status, flags);
    return ended < 0 && errno == EINTR ? 0 : ended;
}

// Its output is closed, as at its end. One that only closed it is ended.
static int wait_for_end(const struct child *child) {
    int status = 0;
    pid_t ended = 0;
    close(child->from);
    for (int i = 0; i < END_MS && !ended; i++) {
        ended = wait_for(child, &status, WNOHANG);
        if (!ended)
            usleep(1000);
    }
    if (!ended)
        kill(child->pid, SIGKILL);
    while (!ended)
        ended = wait_for(child, &status, 0);
    CHECK(ended == child->pid);
    return status;
}

// The first byte is the result, and what follows an error is its text.
static enum result judge(uint8_t *said, size_t size, size_t *out_size, struct error *err) {
    enum result result = (enum result)said[0];
    if ((unsigned)result >= RESULT_COUNT)
        return fail(err, RESULT_FORMAT, "a reader answered what is no result");
    memmove(said, said + 1, size - 1);
    *out_size = size - 1;
    if (result == RESULT_OK)
        return RESULT_OK;
    for (size_t i = 0; i < *out_size; i++)
        if (said[i] < ' ')
            said[i] = ' ';
    return fail(err, result, "%.*s", (int)(*out_size < 380 ? *out_size : 380), (char *)said);
}

enum result confine_run(const char *const arguments[], const struct confine_limits *limits,
                        size_t size_max, uint8_t **out_payload, size_t *out_size,
                        struct error *err) {
    struct child child;
    uint8_t *said;
    *out_payload = NULL;
    signal(SIGCHLD, SIG_DFL); // where it is ignored, the system keeps no status of an ended child
    enum result result = start(arguments, limits, &child, err);
    if (result != RESULT_OK)
        return result;
    size_t size = listen_to(&child, size_max + 1, &said);
    int status = wait_for_end(&child);
    bool whole =
        WIFEXITED(status) && WEXITSTATUS(status) == EXIT_SUCCESS && size && size <= size_max + 1;
    result = whole
                 ? judge(said, size, out_size, err)
                 : fail(err, RESULT_LIMIT,
                        "reading it takes more than %d MB of memory or %d s of processor time, or "
                        "the reader failed",
                        limits->memory_mb, limits->cpu_s);
    if (result == RESULT_OK)
        *out_payload = said;
    else
        free(said);
    return result;
}
