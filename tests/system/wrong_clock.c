// Preloaded into a program: its time of day is off by WRONG_CLOCK_S seconds, or by those that the
// file WRONG_CLOCK_FILE has as a number of 8 bytes, which a test may change at any time. Monotonic
// time stays.
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

int clock_gettime(clockid_t id, struct timespec *out);
time_t time(time_t *out);
int gettimeofday(struct timeval *restrict out, void *restrict zone);

int pthread_cond_timedwait(pthread_cond_t *restrict condition, pthread_mutex_t *restrict lock,
                           const struct timespec *restrict at);

#define YEAR_S 31536000 // no machine runs for ten

static time_t off_s(void) {
    static volatile int64_t *off;
    static int64_t constant;
    if (!off) {
        const char *text = getenv("WRONG_CLOCK_S"), *path = getenv("WRONG_CLOCK_FILE");
        int fd = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
        void *mapped = fd < 0 ? MAP_FAILED : mmap(NULL, sizeof *off, PROT_READ, MAP_SHARED, fd, 0);
        if (fd >= 0)
            close(fd);
        constant = text ? atoll(text) : 0;
        off = mapped == MAP_FAILED ? &constant : mapped;
    }
    return (time_t)*off;
}

static int (*real_clock)(clockid_t id, struct timespec *out);

__attribute__((constructor)) static void find_real_clock(void) {
    *(void **)&real_clock = dlsym(RTLD_NEXT, "clock_gettime"); // which needs no call of the kernel
}

int clock_gettime(clockid_t id, struct timespec *out) {
    int result = real_clock ? real_clock(id, out) : (int)syscall(SYS_clock_gettime, id, out);
    if (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE)
        out->tv_sec += off_s();
    return result;
}

// Until a time of day, or a monotonic one, as the condition is made.
int pthread_cond_timedwait(pthread_cond_t *restrict condition, pthread_mutex_t *restrict lock,
                           const struct timespec *restrict at) {
    static int (*next)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
    struct timespec real = *at;
    if (!next)
        *(void **)&next = dlsym(RTLD_NEXT, "pthread_cond_timedwait");
    if (at->tv_sec > 10L * YEAR_S)
        real.tv_sec -= off_s();
    return next(condition, lock, &real);
}

time_t time(time_t *out) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (out)
        *out = now.tv_sec;
    return now.tv_sec;
}

int gettimeofday(struct timeval *restrict out, void *restrict zone) {
    struct timespec now;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &now);
    *out = (struct timeval){now.tv_sec, now.tv_nsec / 1000};
    return 0;
}
