// pthread, semaphores and clocks, as the rooms call them, on the threads of threads.h. Outside of
// the simulation's threads nobody waits.
#include "base/check.h"
#include "base/clock.h"
#include "sim/threads.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

// 2027-01-15, before the sim's first moment.
#define UTC_NS (INT64_C(1800000000) * NS_PER_S)

// ---- clocks -------------------------------------------------------------------------------------

static int64_t clock_ns(clockid_t id) {
    struct sim_process *process = sim_process();
    int64_t local_ns = process ? sim_local_ns(process, sim_now_ns()) : sim_now_ns();
    if (id != CLOCK_REALTIME)
        return local_ns;
    return UTC_NS + (process ? sim_now_ns() + process->utc_ahead_ns : sim_now_ns());
}

int __wrap_clock_gettime(clockid_t id, struct timespec *out);
int __wrap_clock_gettime(clockid_t id, struct timespec *out) {
    int64_t ns = clock_ns(id);
    *out = (struct timespec){ns / NS_PER_S, ns % NS_PER_S};
    return 0;
}

time_t __wrap_time(time_t *out);
time_t __wrap_time(time_t *out) {
    time_t now = clock_ns(CLOCK_REALTIME) / NS_PER_S;
    if (out)
        *out = now;
    return now;
}

int __wrap_nanosleep(const struct timespec *time, struct timespec *left);
int __wrap_nanosleep(const struct timespec *time, struct timespec *left) {
    (void)left;
    sim_sleep(time->tv_sec * NS_PER_S + time->tv_nsec);
    return 0;
}

static int64_t true_time(const struct timespec *local) {
    return sim_true_ns(sim_process(), local->tv_sec * NS_PER_S + local->tv_nsec);
}

// ---- threads ------------------------------------------------------------------------------------

int __wrap_pthread_create(pthread_t *out, const pthread_attr_t *attributes, void *(*run)(void *),
                          void *argument);
int __wrap_pthread_create(pthread_t *out, const pthread_attr_t *attributes, void *(*run)(void *),
                          void *argument) {
    (void)attributes;
    CHECK(sim_running());
    *out = (pthread_t)sim_start(sim_process(), run, argument);
    return 0;
}

int __wrap_pthread_join(pthread_t id, void **out_result);
int __wrap_pthread_join(pthread_t id, void **out_result) {
    struct sim_thread *thread = (struct sim_thread *)id;
    CHECK(!out_result);
    while (!sim_is_done(thread))
        sim_wait(thread, INT64_MAX);
    sim_forget(&thread);
    return 0;
}

int __wrap_pthread_setname_np(pthread_t id, const char *name);
int __wrap_pthread_setname_np(pthread_t id, const char *name) {
    (void)id, (void)name;
    return 0;
}

int __wrap_pthread_sigmask(int how, const sigset_t *set, sigset_t *before);
int __wrap_pthread_sigmask(int how, const sigset_t *set, sigset_t *before) {
    (void)how, (void)set, (void)before;
    return 0;
}

int __wrap_sched_setscheduler(pid_t id, int policy, const struct sched_param *parameters);
int __wrap_sched_setscheduler(pid_t id, int policy, const struct sched_param *parameters) {
    (void)id, (void)policy, (void)parameters;
    return 0;
}

int __wrap_setpriority(__priority_which_t which, id_t who, int priority);
int __wrap_setpriority(__priority_which_t which, id_t who, int priority) {
    (void)which, (void)who, (void)priority;
    return 0;
}

// ---- mutexes ------------------------------------------------------------------------------------

struct sim_mutex {
    const void *owner; // NULL: free
};

static struct sim_mutex *mutex_of(pthread_mutex_t *mutex) {
    _Static_assert(sizeof(struct sim_mutex) <= sizeof(pthread_mutex_t), "it fits");
    return (struct sim_mutex *)mutex;
}

int __wrap_pthread_mutex_init(pthread_mutex_t *mutex, const pthread_mutexattr_t *attributes);
int __wrap_pthread_mutex_init(pthread_mutex_t *mutex, const pthread_mutexattr_t *attributes) {
    CHECK(!attributes);
    memset(mutex, 0, sizeof *mutex);
    return 0;
}

int __wrap_pthread_mutex_destroy(pthread_mutex_t *mutex);
int __wrap_pthread_mutex_destroy(pthread_mutex_t *mutex) {
    CHECK(!mutex_of(mutex)->owner);
    return 0;
}

static const void *myself(void) {
    static const char outside;
    return sim_running() ? (const void *)sim_running() : &outside;
}

int __wrap_pthread_mutex_lock(pthread_mutex_t *mutex);
int __wrap_pthread_mutex_lock(pthread_mutex_t *mutex) {
    struct sim_mutex *m = mutex_of(mutex);
    CHECK(m->owner != myself());
    while (m->owner)
        sim_wait(m, INT64_MAX);
    m->owner = myself();
    return 0;
}

int __wrap_pthread_mutex_trylock(pthread_mutex_t *mutex);
int __wrap_pthread_mutex_trylock(pthread_mutex_t *mutex) {
    struct sim_mutex *m = mutex_of(mutex);
    if (m->owner)
        return EBUSY;
    m->owner = myself();
    return 0;
}

int __wrap_pthread_mutex_unlock(pthread_mutex_t *mutex);
int __wrap_pthread_mutex_unlock(pthread_mutex_t *mutex) {
    struct sim_mutex *m = mutex_of(mutex);
    CHECK(m->owner == myself());
    m->owner = NULL;
    sim_wake_one(m);
    return 0;
}

// ---- conditions ---------------------------------------------------------------------------------

int __wrap_pthread_cond_init(pthread_cond_t *condition, const pthread_condattr_t *attributes);
int __wrap_pthread_cond_init(pthread_cond_t *condition, const pthread_condattr_t *attributes) {
    (void)attributes; // all of them follow the monotonic clock
    memset(condition, 0, sizeof *condition);
    return 0;
}

int __wrap_pthread_cond_destroy(pthread_cond_t *condition);
int __wrap_pthread_cond_destroy(pthread_cond_t *condition) {
    (void)condition;
    return 0;
}

static int wait_on(pthread_cond_t *condition, pthread_mutex_t *mutex, int64_t until_ns) {
    __wrap_pthread_mutex_unlock(mutex);
    bool woken = sim_wait(condition, until_ns);
    __wrap_pthread_mutex_lock(mutex);
    return woken ? 0 : ETIMEDOUT;
}

int __wrap_pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *mutex);
int __wrap_pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *mutex) {
    return wait_on(condition, mutex, INT64_MAX);
}

int __wrap_pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                                  const struct timespec *until);
int __wrap_pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                                  const struct timespec *until) {
    return wait_on(condition, mutex, true_time(until));
}

int __wrap_pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex, clockid_t id,
                                  const struct timespec *until);
int __wrap_pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex, clockid_t id,
                                  const struct timespec *until) {
    CHECK(id == CLOCK_MONOTONIC);
    return wait_on(condition, mutex, true_time(until));
}

int __wrap_pthread_cond_signal(pthread_cond_t *condition);
int __wrap_pthread_cond_signal(pthread_cond_t *condition) {
    sim_wake_one(condition);
    return 0;
}

int __wrap_pthread_cond_broadcast(pthread_cond_t *condition);
int __wrap_pthread_cond_broadcast(pthread_cond_t *condition) {
    sim_wake(condition);
    return 0;
}

// ---- semaphores ---------------------------------------------------------------------------------

static unsigned *count_of(sem_t *semaphore) {
    return (unsigned *)semaphore;
}

int __wrap_sem_init(sem_t *semaphore, int shared, unsigned value);
int __wrap_sem_init(sem_t *semaphore, int shared, unsigned value) {
    (void)shared;
    *count_of(semaphore) = value;
    return 0;
}

int __wrap_sem_destroy(sem_t *semaphore);
int __wrap_sem_destroy(sem_t *semaphore) {
    (void)semaphore;
    return 0;
}

int __wrap_sem_post(sem_t *semaphore);
int __wrap_sem_post(sem_t *semaphore) {
    ++*count_of(semaphore);
    sim_wake_one(semaphore);
    return 0;
}

int __wrap_sem_trywait(sem_t *semaphore);
int __wrap_sem_trywait(sem_t *semaphore) {
    if (!*count_of(semaphore)) {
        errno = EAGAIN;
        return -1;
    }
    --*count_of(semaphore);
    return 0;
}

int __wrap_sem_clockwait(sem_t *semaphore, clockid_t id, const struct timespec *until);
int __wrap_sem_clockwait(sem_t *semaphore, clockid_t id, const struct timespec *until) {
    CHECK(id == CLOCK_MONOTONIC);
    int64_t until_ns = true_time(until);
    while (!*count_of(semaphore))
        if (sim_now_ns() >= until_ns || !sim_wait(semaphore, until_ns)) {
            errno = ETIMEDOUT;
            return -1;
        }
    --*count_of(semaphore);
    return 0;
}
