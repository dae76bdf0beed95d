#include "runtime/keeper.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#define KEEPER_NICE 15
#define TRIES 100 // until the trace is written so far
static const struct timespec try_again = {.tv_nsec = 20 * NS_PER_MS};

struct keeper_task {
    struct keeper_task *next;
    struct session_image *image; // NULL: the state is removed
    char trace[TRACE_FILE_MAX];
};

struct keeper {
    const struct runtime_config *config;
    pthread_t thread;
    pthread_mutex_t lock; // of all below; held for moments
    pthread_cond_t work;
    struct keeper_task *first, **end;
    bool stop;
    bool failing; // the last state could not be written; the thread's
};

// ---- the thread ---------------------------------------------------------------------------------

// The trace is written every 20 ms; the state is ahead of it by no more.
static enum result write_state(struct session_image *image, struct error *err) {
    enum result result = RESULT_MISSING;
    kept_session_join(&image->session, &image->operation, &image->state);
    for (int i = 0; i < TRIES && result == RESULT_MISSING; i++) {
        if (i)
            nanosleep(&try_again, NULL);
        result = trace_state_write(image->trace, &image->state, err);
    }
    free(image->state.content);
    image->state.content = NULL;
    return result;
}

static void write_image(struct keeper *k, struct session_image *image) {
    struct error err;
    bool failed = write_state(image, &err) != RESULT_OK;
    if (failed && !k->failing)
        log_warning("sessions", "a session's state is not kept, so a restart takes longer: %s",
                    err.text);
    k->failing = failed;
    if (!failed && k->config->kept)
        k->config->kept(k->config->user, image->trace);
    free(image->operation.data);
    image->operation = (struct kept){0};
    atomic_store(&image->busy, false);
}

static void *run_keeper(void *argument) {
    struct keeper *k = argument;
    setpriority(PRIO_PROCESS, 0, KEEPER_NICE); // Linux: of this thread
    pthread_mutex_lock(&k->lock);
    while (k->first || !k->stop) {
        struct keeper_task *task = k->first;
        if (!task) {
            pthread_cond_wait(&k->work, &k->lock);
            continue;
        }
        k->first = task->next;
        if (!k->first)
            k->end = &k->first;
        pthread_mutex_unlock(&k->lock);
        if (task->image)
            write_image(k, task->image);
        else
            trace_state_remove(task->trace);
        free(task);
        pthread_mutex_lock(&k->lock);
    }
    pthread_mutex_unlock(&k->lock);
    return NULL;
}

struct keeper *keeper_create(const struct runtime_config *config) {
    struct keeper *k = alloc(1, sizeof *k);
    k->config = config;
    k->end = &k->first;
    pthread_mutex_init(&k->lock, NULL);
    pthread_cond_init(&k->work, NULL);
    int failed = pthread_create(&k->thread, NULL, run_keeper, k);
    NEED(!failed, "thread");
    return k;
}

void keeper_destroy(struct keeper **keeper) {
    struct keeper *k = *keeper;
    if (!k)
        return;
    pthread_mutex_lock(&k->lock);
    k->stop = true;
    pthread_cond_signal(&k->work);
    pthread_mutex_unlock(&k->lock);
    pthread_join(k->thread, NULL);
    pthread_cond_destroy(&k->work);
    pthread_mutex_destroy(&k->lock);
    free(k);
    *keeper = NULL;
}

struct session_image *session_image_create(void) {
    struct session_image *image = alloc(1, sizeof *image);
    image->session = kept_into(alloc(KEPT_SESSION_MAX, 1), KEPT_SESSION_MAX);
    return image;
}

void session_image_destroy(struct session_image **image) {
    if (*image) {
        free((*image)->session.data);
        free((*image)->operation.data);
    }
    free(*image);
    *image = NULL;
}

// ---- what others give it ------------------------------------------------------------------------

static void give_image(struct keeper *k, struct session_image *image, const char *trace) {
    struct keeper_task *task = alloc(1, sizeof *task);
    task->image = image;
    memcpy(task->trace, trace, sizeof task->trace);
    pthread_mutex_lock(&k->lock);
    *k->end = task;
    k->end = &task->next;
    pthread_cond_signal(&k->work);
    pthread_mutex_unlock(&k->lock);
}

void keeper_write(struct keeper *k, struct session_image *image) {
    give_image(k, image, image->trace);
}

void keeper_remove(struct keeper *k, const char *trace) {
    give_image(k, NULL, trace);
}
