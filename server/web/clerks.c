#include "web/clerks.h"

#include "base/check.h"

#include <pthread.h>
#include <stdlib.h>

#define CLERKS 2

// First in, first out.
struct line {
    struct job *first, **end;
    int length;
};

struct clerks {
    struct web_handler handler;
    void (*on_done)(void *user);
    void *user;
    struct shelf *shelf;
    pthread_t threads[CLERKS];
    pthread_mutex_t lock; // guards what follows
    pthread_cond_t wake;
    bool stops;
    struct line urgent; // an account is looked up, a file read on: before whole requests
    struct line requests;
    struct line done;
};

// ---- lines --------------------------------------------------------------------------------------

static void line_up(struct line *line, struct job *job) {
    if (line->length++ == 0)
        line->end = &line->first;
    *line->end = job;
    line->end = &job->next;
    job->next = NULL;
}

static struct job *line_next(struct line *line) {
    if (line->length == 0)
        return NULL;
    struct job *job = line->first;
    line->first = job->next;
    line->length--;
    return job;
}

static void line_clear(struct line *line) {
    for (struct job *job; (job = line_next(line));)
        job_destroy(&job);
}

// ---- jobs ---------------------------------------------------------------------------------------

struct job *job_create(enum job_kind kind, void *owner) {
    struct job *job = alloc(1, sizeof *job);
    job->kind = kind;
    job->owner = owner;
    job->answer = answer_none();
    return job;
}

void job_destroy(struct job **job) {
    if (!*job)
        return;
    answer_release(&(*job)->answer);
    free((*job)->body);
    free(*job);
    *job = NULL;
}

static void ask(struct clerks *c, struct job *job) {
    struct web_response response = {0};
    const struct web_request request = {
        .method = job->method,
        .path = job->path,
        .query = job->query,
        .body = job->body ? job->body : "",
        .size = job->size,
        .token = job->token[0] ? job->token : NULL,
        .by_cookie = job->by_cookie,
        .address = job->address,
    };
    c->handler.on_request(c->handler.user, &request, &response);
    job->answer = answer_of(&response, &job->wishes, c->shelf);
}

static void work(struct clerks *c, struct job *job) {
    switch (job->kind) {
    case JOB_ENTER:
        job->entry = c->handler.on_enter(c->handler.user, job->token, &job->account);
        break;
    case JOB_REQUEST:
        ask(c, job);
        break;
    case JOB_READ:
        job->failed = !answer_read(&job->answer);
        break;
    }
}

static struct job *next_job(struct clerks *c) {
    struct job *job = line_next(&c->urgent);
    return job ? job : line_next(&c->requests);
}

static void *serve(void *argument) {
    struct clerks *c = argument;
    pthread_mutex_lock(&c->lock);
    while (!c->stops) {
        struct job *job = next_job(c);
        if (!job) {
            pthread_cond_wait(&c->wake, &c->lock);
            continue;
        }
        pthread_mutex_unlock(&c->lock);
        work(c, job);
        pthread_mutex_lock(&c->lock);
        line_up(&c->done, job);
        c->on_done(c->user);
    }
    pthread_mutex_unlock(&c->lock);
    return NULL;
}

// ---- the web thread -----------------------------------------------------------------------------

bool clerks_give(struct clerks *c, struct job *job) {
    pthread_mutex_lock(&c->lock);
    struct line *line = job->kind == JOB_REQUEST ? &c->requests : &c->urgent;
    bool taken = line != &c->requests || line->length < CLERKS_WAITING_MAX;
    if (taken) {
        line_up(line, job);
        pthread_cond_signal(&c->wake);
    }
    pthread_mutex_unlock(&c->lock);
    return taken;
}

struct job *clerks_take(struct clerks *c) {
    pthread_mutex_lock(&c->lock);
    struct job *job = line_next(&c->done);
    pthread_mutex_unlock(&c->lock);
    return job;
}

struct clerks *clerks_create(const struct web_handler *handler, void (*on_done)(void *user),
                             void *user) {
    struct clerks *c = alloc(1, sizeof *c);
    c->handler = *handler;
    c->on_done = on_done;
    c->user = user;
    c->shelf = shelf_create(SHELF_BYTES);
    pthread_mutex_init(&c->lock, NULL);
    pthread_cond_init(&c->wake, NULL);
    for (int i = 0; i < CLERKS; i++)
        CHECK(pthread_create(&c->threads[i], NULL, serve, c) == 0);
    return c;
}

void clerks_stop(struct clerks *c) {
    pthread_mutex_lock(&c->lock);
    c->stops = true;
    pthread_cond_broadcast(&c->wake);
    pthread_mutex_unlock(&c->lock);
    for (int i = 0; i < CLERKS; i++)
        pthread_join(c->threads[i], NULL);
}

void clerks_destroy(struct clerks **clerks) {
    struct clerks *c = *clerks;
    line_clear(&c->urgent);
    line_clear(&c->requests);
    line_clear(&c->done);
    shelf_destroy(&c->shelf);
    pthread_cond_destroy(&c->wake);
    pthread_mutex_destroy(&c->lock);
    free(c);
    *clerks = NULL;
}
