// Preloaded into a program: its monotonic clock is off by what the file STEP_CLOCK_FILE says, a
// number of 8 bytes in nanoseconds, which a test may change at any time.
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define NS_PER_S 1000000000LL

int clock_gettime(clockid_t id, struct timespec *out);
int clock_nanosleep(clockid_t id, int flags, const struct timespec *at, struct timespec *left);
int pthread_cond_timedwait(pthread_cond_t *restrict condition, pthread_mutex_t *restrict lock,
                           const struct timespec *restrict at);

static int64_t off_ns(void) {
    static volatile int64_t *off;
    static const int64_t none;
    if (!off) {
        const char *path = getenv("STEP_CLOCK_FILE");
        int fd = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
        void *mapped = fd < 0 ? MAP_FAILED : mmap(NULL, sizeof *off, PROT_READ, MAP_SHARED, fd, 0);
        if (fd >= 0)
            close(fd);
        off = mapped == MAP_FAILED ? (volatile int64_t *)&none : mapped;
    }
    return *off;
}

static struct timespec moved(const struct timespec *at, int64_t by_ns) {
    int64_t ns = at->tv_sec * NS_PER_S + at->tv_nsec + by_ns;
    ns = ns < 0 ? 0 : ns;
    return (struct timespec){ns / NS_PER_S, ns % NS_PER_S};
}

int clock_gettime(clockid_t id, struct timespec *out) {
    int result = (int)syscall(SYS_clock_gettime, id, out);
    if (id == CLOCK_MONOTONIC)
        *out = moved(out, off_ns());
    return result;
}

// All that these programs wait for by a time is on this clock.
int clock_nanosleep(clockid_t id, int flags, const struct timespec *at, struct timespec *left) {
    struct timespec real = flags & TIMER_ABSTIME ? moved(at, -off_ns()) : *at;
    return syscall(SYS_clock_nanosleep, id, flags, &real, left) ? 4 : 0; // EINTR: ask again
}

int pthread_cond_timedwait(pthread_cond_t *restrict condition, pthread_mutex_t *restrict lock,
                           const struct timespec *restrict at) {
    static int (*next)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
    if (!next)
        *(void **)&next = dlsym(RTLD_NEXT, "pthread_cond_timedwait");
    struct timespec real = moved(at, -off_ns());
    return next(condition, lock, &real);
}
