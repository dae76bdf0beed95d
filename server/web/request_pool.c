#include "web/request_pool.h"

#include "base/check.h"
#include "base/task_pool.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define THREADS 2
#define SLOW_THREADS 3
#define SLOW_NICE 15    // behind steps, cuts and reports
#define URGENT_MAX 4096 // one of each connection, and those of connections that have ended

struct request_pool {
    struct web_handler handler;
    void (*on_done)(void *user);
    void *user;
    struct gzip_cache *cache;
    struct task_pool *tasks, *slow, *later;
    pthread_mutex_t lock; // guards what follows
    struct web_task *first_done, **end_done;
};

// ---- tasks --------------------------------------------------------------------------------------

struct web_task *web_task_create(enum web_task_kind kind, void *owner) {
    struct web_task *task = alloc(1, sizeof *task);
    task->kind = kind;
    task->owner = owner;
    task->answer = answer_none();
    return task;
}

void web_task_destroy(struct web_task **task) {
    if (!*task)
        return;
    answer_release(&(*task)->answer);
    if ((*task)->later)
        (*task)->later((*task)->later_data, NULL);
    free((*task)->body);
    free(*task);
    *task = NULL;
}

static void take_response(struct web_task *task, struct web_response *response) {
    memcpy(task->downloader, response->owner, sizeof task->downloader);
    task->answer = answer_of(response, &task->options, task->pool->cache);
}

static void answer_request(struct request_pool *p, struct web_task *task) {
    struct web_response response = {0};
    const struct web_request request = {
        .method = task->method,
        .path = task->path,
        .query = task->query,
        .body = task->body ? task->body : "",
        .size = task->size,
        .token = task->token[0] ? task->token : NULL,
        .by_cookie = task->by_cookie,
        .device = task->device[0] ? task->device : NULL,
        .sign_on = task->sign_on[0] ? task->sign_on : NULL,
        .host = task->host,
        .address = task->address,
        .is_near = task->is_near,
        .is_passed_on = task->is_passed_on,
        .takes_openmetrics = task->takes_openmetrics,
        .range = task->options.range[0] ? task->options.range : NULL,
        .if_range = task->options.if_range[0] ? task->options.if_range : NULL,
    };
    p->handler.on_request(p->handler.user, &request, &response);
    task->account = response.account;
    task->later = response.later;
    task->later_data = response.later_data;
    if (!task->later)
        take_response(task, &response);
}

static int64_t run_later(void *data) {
    struct web_task *task = data;
    struct web_response response = {0};
    task->later(task->later_data, &response);
    task->later = NULL;
    take_response(task, &response);
    return TASK_DONE;
}

static int64_t run(void *data) {
    struct web_task *task = data;
    struct request_pool *p = task->pool;
    switch (task->kind) {
    case WEB_TASK_ACCOUNT:
        task->entry = p->handler.on_enter(p->handler.user, task->token, &task->account);
        break;
    case WEB_TASK_REQUEST:
        answer_request(p, task);
        break;
    case WEB_TASK_FILE:
        task->failed = !answer_read(&task->answer);
        break;
    }
    return TASK_DONE;
}

static void finish_task(void *data, bool done);

// False: too many wait.
static bool add_later(struct web_task *task) {
    return task_pool_add(
        task->pool->later,
        &(struct pool_task){.run = run_later, .finish = finish_task, .data = task});
}

static void finish_task(void *data, bool done) {
    struct web_task *task = data;
    struct request_pool *p = task->pool;
    if (done && task->later && add_later(task))
        return;
    if (done && task->later)
        task->answer = answer_refusal(503, "busy", "The server is too busy; try again.", false);
    pthread_mutex_lock(&p->lock);
    task->next = NULL;
    *p->end_done = task;
    p->end_done = &task->next;
    pthread_mutex_unlock(&p->lock);
    if (done)
        p->on_done(p->user);
}

// ---- the web thread -----------------------------------------------------------------------------

bool request_pool_add(struct request_pool *p, struct web_task *task) {
    bool urgent = task->kind != WEB_TASK_REQUEST; // a running download goes before a new request
    task->pool = p;
    bool slow = task->kind == WEB_TASK_REQUEST && p->handler.is_slow &&
                p->handler.is_slow(task->method, task->path);
    return task_pool_add(
        slow ? p->slow : p->tasks,
        &(struct pool_task){.urgent = urgent, .run = run, .finish = finish_task, .data = task});
}

struct web_task *request_pool_take_done(struct request_pool *p) {
    pthread_mutex_lock(&p->lock);
    struct web_task *task = p->first_done;
    if (task) {
        p->first_done = task->next;
        if (!p->first_done)
            p->end_done = &p->first_done;
    }
    pthread_mutex_unlock(&p->lock);
    return task;
}

struct request_pool *request_pool_create(const struct web_handler *handler,
                                         void (*on_done)(void *user), void *user) {
    const struct task_pool_settings settings = {.threads = THREADS,
                                                .tasks_max = REQUEST_POOL_WAITING_MAX + THREADS,
                                                .urgent_max = URGENT_MAX};
    const struct task_pool_settings slow = {.threads = SLOW_THREADS,
                                            .tasks_max = REQUEST_POOL_WAITING_MAX + SLOW_THREADS,
                                            .nice = SLOW_NICE};
    const struct task_pool_settings later = {
        .threads = WEB_LATER_THREADS, .tasks_max = REQUEST_POOL_WAITING_MAX + WEB_LATER_THREADS};
    struct request_pool *p = alloc(1, sizeof *p);
    p->handler = *handler;
    p->on_done = on_done;
    p->user = user;
    p->cache = gzip_cache_create(GZIP_CACHE_BYTES);
    p->end_done = &p->first_done;
    pthread_mutex_init(&p->lock, NULL);
    p->tasks = task_pool_create(&settings);
    p->slow = task_pool_create(&slow);
    p->later = task_pool_create(&later);
    return p;
}

void request_pool_stop(struct request_pool *p) {
    task_pool_stop(p->tasks);
    task_pool_stop(p->slow);
    task_pool_stop(p->later);
}

void request_pool_destroy(struct request_pool **pool) {
    struct request_pool *p = *pool;
    task_pool_destroy(&p->tasks);
    task_pool_destroy(&p->slow);
    task_pool_destroy(&p->later);
    for (struct web_task *task; (task = request_pool_take_done(p));)
        web_task_destroy(&task);
    gzip_cache_destroy(&p->cache);
    pthread_mutex_destroy(&p->lock);
    free(p);
    *pool = NULL;
}
