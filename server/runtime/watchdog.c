#include "runtime/watchdog.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/service.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define ALIVE_EVERY_NS (NS_PER_S / 2)
#define LATE_NS (WATCHDOG_LOOK_NS / 4)

struct guarded {
    struct watched watched;
    char name[32];
    struct watch watch;
    int thread, stat_fd; // -1: not opened
};

struct watchdog {
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t ends;
    bool stop;
    const char *(*station_name)(const void *user, int station);
    const void *user;
    int64_t told_ns;
    atomic_int_fast64_t looked_ns;
    int count;
    struct guarded guarded[];
};

void progress_begin(struct progress *progress, const char *name, int index) {
    char whole[16];
    snprintf(whole, sizeof whole, "%s %d", name, index);
    pthread_setname_np(pthread_self(), whole);
    progress_note(progress, "begins", -1);
    atomic_store(&progress->thread, gettid());
}

void progress_end(struct progress *progress) {
    atomic_store(&progress->thread, 0);
}

// ---- one thread ---------------------------------------------------------------------------------

bool watch_judge(struct watch *w, const struct watch_look *look) {
    int64_t passed_ns = look->now_ns - w->looked_ns;
    int64_t computed_ns = look->computed_ns - w->computed_ns;
    bool first = !w->looked_ns;
    w->looked_ns = look->now_ns;
    if (first || look->beats != w->beats) {
        w->beats = look->beats;
        w->beat_ns = look->now_ns;
        w->computed_ns = look->computed_ns;
        w->blocked_ns = 0;
        return false;
    }
    if (!look->waits_for_processor && passed_ns <= WATCHDOG_LOOK_NS + LATE_NS)
        w->blocked_ns += passed_ns;
    return w->blocked_ns >= w->patience_ns || computed_ns >= w->patience_ns;
}

// The state and the time of a thread, as proc(5) tells them. False: it is gone.
static bool look_at(struct guarded *g, struct watch_look *out) {
    char text[1024];
    ssize_t size = g->stat_fd < 0 ? -1 : pread(g->stat_fd, text, sizeof text - 1, 0);
    if (size <= 0)
        return false;
    text[size] = '\0';
    const char *after_name = strrchr(text, ')');
    char state;
    unsigned long user, kernel;
    if (!after_name || sscanf(after_name + 1, " %c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu",
                              &state, &user, &kernel) != 3)
        return false;
    out->waits_for_processor = state == 'R';
    out->computed_ns = (int64_t)(user + kernel) * (NS_PER_S / sysconf(_SC_CLK_TCK));
    return true;
}

static void follow_thread(struct guarded *g, int thread) {
    char path[64];
    if (thread == g->thread && (g->stat_fd >= 0 || !thread))
        return;
    if (g->stat_fd >= 0)
        close(g->stat_fd);
    snprintf(path, sizeof path, "/proc/self/task/%d/stat", thread);
    g->stat_fd = thread ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    g->thread = thread;
    g->watch = (struct watch){.patience_ns = g->watched.patience_ns};
}

static bool hangs(struct guarded *g) {
    struct progress *p = g->watched.progress;
    follow_thread(g, atomic_load(&p->thread));
    struct watch_look look = {.now_ns = clock_now_ns(), .beats = atomic_load(&p->beats)};
    return look_at(g, &look) && atomic_load(&p->thread) == g->thread &&
           watch_judge(&g->watch, &look);
}

// The log's lock may be what the thread hangs on.
static _Noreturn void end_process(struct watchdog *w, const struct guarded *g) {
    char text[512], when[32], about[128] = "";
    const struct progress *p = g->watched.progress;
    int station = atomic_load(&p->station);
    if (station >= 0)
        snprintf(about, sizeof about, " of station %s", w->station_name(w->user, station));
    time_t now = time(NULL);
    struct tm utc;
    gmtime_r(&now, &utc);
    strftime(when, sizeof when, "%Y-%m-%dT%H:%M:%S.000Z", &utc);
    int size = snprintf(text, sizeof text,
                        "%s error watchdog: %s hangs: nothing for %.1f s. It last did: %s%s. The "
                        "server ends, so that it can be started again\n",
                        when, g->name, (double)(clock_now_ns() - g->watch.beat_ns) / 1e9,
                        atomic_load(&p->doing), about);
    if (write(STDERR_FILENO, text, (size_t)size) != size) {
        // there is nobody to tell
    }
    say_last_words();
    abort();
}

// ---- the thread ---------------------------------------------------------------------------------

static void look_at_all(struct watchdog *w) {
    for (int i = 0; i < w->count; i++)
        if (hangs(&w->guarded[i]))
            end_process(w, &w->guarded[i]);
    int64_t now_ns = clock_now_ns();
    atomic_store(&w->looked_ns, now_ns);
    if (now_ns - w->told_ns < ALIVE_EVERY_NS)
        return;
    service_notify("WATCHDOG=1");
    w->told_ns = now_ns;
}

static void *keep_watch(void *argument) {
    struct watchdog *w = argument;
    pthread_setname_np(pthread_self(), "watchdog");
    pthread_mutex_lock(&w->lock);
    while (!w->stop) {
        int64_t until_ns = clock_now_ns() + WATCHDOG_LOOK_NS;
        struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
        pthread_cond_timedwait(&w->ends, &w->lock, &until);
        if (!w->stop)
            look_at_all(w);
    }
    pthread_mutex_unlock(&w->lock);
    return NULL;
}

struct watchdog *watchdog_create(const struct watched *watched, int count,
                                 const char *(*station_name)(const void *user, int station),
                                 const void *user) {
    struct watchdog *w = alloc(1, sizeof *w + (size_t)count * sizeof *w->guarded);
    w->station_name = station_name;
    w->user = user;
    w->count = count;
    w->looked_ns = clock_now_ns();
    for (int i = 0; i < count; i++) {
        w->guarded[i] = (struct guarded){.watched = watched[i], .stat_fd = -1};
        snprintf(w->guarded[i].name, sizeof w->guarded[i].name, "%s", watched[i].name);
    }
    pthread_mutex_init(&w->lock, NULL);
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&w->ends, &monotonic);
    pthread_condattr_destroy(&monotonic);
    int failed = pthread_create(&w->thread, NULL, keep_watch, w);
    NEED(!failed, "thread");
    return w;
}

int64_t watchdog_looked_ns(const struct watchdog *w) {
    return atomic_load(&w->looked_ns);
}

void watchdog_destroy(struct watchdog **watchdog) {
    struct watchdog *w = *watchdog;
    if (!w)
        return;
    pthread_mutex_lock(&w->lock);
    w->stop = true;
    pthread_cond_signal(&w->ends);
    pthread_mutex_unlock(&w->lock);
    pthread_join(w->thread, NULL);
    for (int i = 0; i < w->count; i++)
        if (w->guarded[i].stat_fd >= 0)
            close(w->guarded[i].stat_fd);
    pthread_cond_destroy(&w->ends);
    pthread_mutex_destroy(&w->lock);
    free(w);
    *watchdog = NULL;
}
