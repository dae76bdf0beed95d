// Threads, processes, events, waiting and time.
#include "failing.h"

#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/random.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

CALL(THREAD, EAGAIN, int, pthread_create,
     (pthread_t *restrict out, const pthread_attr_t *restrict attributes, void *(*run)(void *),
      void *restrict argument),
     (out, attributes, run, argument))

// ---- processes and their bounds -----------------------------------------------------------------

CALL(PROCESS, -1, pid_t, fork, (void), ())
CALL(PROCESS, EAGAIN, int, posix_spawn,
     (pid_t *restrict out, const char *restrict path,
      const posix_spawn_file_actions_t *restrict actions,
      const posix_spawnattr_t *restrict attributes, char *const argv[restrict],
      char *const variables[restrict]),
     (out, path, actions, attributes, argv, variables))
CALL(PROCESS, ENOMEM, int, posix_spawn_file_actions_adddup2,
     (posix_spawn_file_actions_t * actions, int from, int to), (actions, from, to))
CALL(LIMIT, -1, int, getrlimit, (__rlimit_resource_t kind, struct rlimit *out), (kind, out))
CALL(LIMIT, -1, int, setrlimit, (__rlimit_resource_t kind, const struct rlimit *limit),
     (kind, limit))
CALL(LIMIT, -1, int, setpriority, (__priority_which_t which, id_t who, int value),
     (which, who, value))
CALL(LIMIT, -1, int, sched_setscheduler, (pid_t id, int policy, const struct sched_param *priority),
     (id, policy, priority))
CALL(LIMIT, -1, int, close_range, (unsigned first, unsigned last, int flags), (first, last, flags))

int prctl(int option, ...) {
    unsigned long values[4];
    va_list rest;
    va_start(rest, option);
    for (int i = 0; i < 4; i++)
        values[i] = va_arg(rest, unsigned long);
    va_end(rest);
    return FAILS(LIMIT)
               ? -1
               : (int)syscall(SYS_prctl, option, values[0], values[1], values[2], values[3]);
}

// ---- descriptors that are no files --------------------------------------------------------------

CALL(EVENT, -1, int, eventfd, (unsigned value, int flags), (value, flags))
CALL(EVENT, -1, int, pipe, (int fds[2]), (fds))
CALL(EVENT, -1, int, pipe2, (int fds[2], int flags), (fds, flags))
CALL(EVENT, -1, int, dup, (int fd), (fd))
CALL(EVENT, -1, int, dup2, (int fd, int to), (fd, to))
CALL(EVENT, -1, int, epoll_create1, (int flags), (flags))
CALL(EVENT, -1, int, epoll_ctl, (int fd, int what, int of, struct epoll_event *event),
     (fd, what, of, event))
CALL(EVENT, -1, int, timerfd_create, (clockid_t id, int flags), (id, flags))
CALL(EVENT, -1, int, timerfd_settime,
     (int fd, int flags, const struct itimerspec *at, struct itimerspec *out_before),
     (fd, flags, at, out_before))

// ---- waiting: a signal interrupts ---------------------------------------------------------------

CALL(POLL, -1, int, poll, (struct pollfd * fds, nfds_t count, int timeout_ms),
     (fds, count, timeout_ms))
CALL(POLL, -1, int, __poll_chk, (struct pollfd * fds, nfds_t count, int timeout_ms, size_t room),
     (fds, count, timeout_ms, room))
CALL(POLL, -1, int, ppoll,
     (struct pollfd * fds, nfds_t count, const struct timespec *timeout, const sigset_t *signals),
     (fds, count, timeout, signals))
CALL(POLL, -1, int, __ppoll_chk,
     (struct pollfd * fds, nfds_t count, const struct timespec *timeout, const sigset_t *signals,
      size_t room),
     (fds, count, timeout, signals, room))
CALL(POLL, -1, int, epoll_wait, (int fd, struct epoll_event *out, int most, int timeout_ms),
     (fd, out, most, timeout_ms))
CALL(WAIT, -1, int, sem_wait, (sem_t * semaphore), (semaphore))
CALL(WAIT, -1, int, sem_clockwait,
     (sem_t *restrict semaphore, clockid_t id, const struct timespec *restrict until),
     (semaphore, id, until))
CALL(WAIT, -1, int, nanosleep, (const struct timespec *time, struct timespec *out_rest),
     (time, out_rest))
CALL(WAIT, EINTR, int, clock_nanosleep,
     (clockid_t id, int flags, const struct timespec *time, struct timespec *out_rest),
     (id, flags, time, out_rest))
CALL(WAIT, -1, pid_t, waitpid, (pid_t id, int *out_status, int flags), (id, out_status, flags))
CALL(WAIT, -1, int, sigtimedwait,
     (const sigset_t *restrict set, siginfo_t *restrict out,
      const struct timespec *restrict timeout),
     (set, out, timeout))

// ---- chance and time ----------------------------------------------------------------------------

CALL(RANDOM, -1, ssize_t, getrandom, (void *out, size_t size, unsigned flags), (out, size, flags))
CALL(RANDOM, -1, int, getentropy, (void *out, size_t size), (out, size))

#define AHEAD_S 3600
#define NS_PER_S 1000000000LL

static int read_clock(clockid_t id, struct timespec *out, const void *address) {
    int result = (int)syscall(SYS_clock_gettime, id, out);
    if (id != CLOCK_REALTIME && id != CLOCK_REALTIME_COARSE)
        return result;
    long long now = out->tv_sec * NS_PER_S + out->tv_nsec + failing_clock_off_ns();
    out->tv_sec = now / NS_PER_S + (failing_now(CLOCK, address) ? AHEAD_S : 0);
    out->tv_nsec = now % NS_PER_S;
    return result;
}

int clock_gettime(clockid_t id, struct timespec *out) {
    return read_clock(id, out, __builtin_return_address(0));
}

time_t time(time_t *out) {
    struct timespec now;
    read_clock(CLOCK_REALTIME, &now, __builtin_return_address(0));
    if (out)
        *out = now.tv_sec;
    return now.tv_sec;
}
