#include "records/scoring.h"

#include "base/check.h"
#include "base/log.h"
#include "records/waiting.h"

#include <pthread.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/stat.h>

#define SCORING_NICE 10 // behind workers; somebody waits for the report
#define IN_A_HURRY_BYTES (64 << 20)

struct scoring {
    struct scoring_config config;
    pthread_t thread;
    pthread_mutex_t mutex; // of all below
    pthread_cond_t wake;
    struct waiting_list rows;
    bool hurry, stop;
};

// The next one, or NULL at the end.
static struct waiting *next_row(struct scoring *s, bool *out_hurry) {
    pthread_mutex_lock(&s->mutex);
    while (!s->rows.first && !s->stop)
        pthread_cond_wait(&s->wake, &s->mutex);
    struct waiting *next = s->rows.first ? waiting_take(&s->rows) : NULL;
    *out_hurry = s->hurry;
    pthread_mutex_unlock(&s->mutex);
    return next;
}

static bool is_small(const char *trace) {
    struct stat status;
    return stat(trace, &status) == 0 && status.st_size < IN_A_HURRY_BYTES;
}

static void score(const struct scoring_config *c, const char *trace) {
    struct session_score score;
    struct error err;
    if (session_score_trace(trace, c->authority, c->find, c->user, &score, &err) == RESULT_OK)
        c->scored(c->owner, &score);
    else
        log_error("records", "%s; the records get neither hash nor results of the session",
                  err.text);
}

static void *run_scoring(void *argument) {
    struct scoring *s = argument;
    struct waiting *next;
    bool hurry;
    setpriority(PRIO_PROCESS, 0, SCORING_NICE); // Linux: of this thread
    while ((next = next_row(s, &hurry))) {
        if (!hurry || is_small(next->row.trace))
            score(&s->config, next->row.trace);
        waiting_free(next);
    }
    return NULL;
}

struct scoring *scoring_start(const struct scoring_config *config) {
    struct scoring *s = alloc(1, sizeof *s);
    s->config = *config;
    pthread_mutex_init(&s->mutex, NULL);
    pthread_cond_init(&s->wake, NULL);
    NEED(!pthread_create(&s->thread, NULL, run_scoring, s), "thread");
    return s;
}

void scoring_put(struct scoring *s, const struct store_session *session) {
    pthread_mutex_lock(&s->mutex);
    waiting_append(&s->rows, &(struct waiting){.kind = WAITING_ROW, .row = *session});
    pthread_cond_signal(&s->wake);
    pthread_mutex_unlock(&s->mutex);
}

void scoring_hurry(struct scoring *s) {
    pthread_mutex_lock(&s->mutex);
    s->hurry = true;
    pthread_mutex_unlock(&s->mutex);
}

void scoring_stop(struct scoring **scoring) {
    struct scoring *s = *scoring;
    if (!s)
        return;
    pthread_mutex_lock(&s->mutex);
    s->stop = true;
    pthread_cond_signal(&s->wake);
    pthread_mutex_unlock(&s->mutex);
    pthread_join(s->thread, NULL);
    pthread_cond_destroy(&s->wake);
    pthread_mutex_destroy(&s->mutex);
    free(s);
    *scoring = NULL;
}
