#include "base/task_pool.h"

#include "base/check.h"
#include "base/clock.h"

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

enum pool_state { OPEN, DRAINING, STOPPED };

// In the list, in the order of adding, from task_pool_add until it is finished.
struct pool_entry {
    struct pool_entry *next;
    struct pool_task task;
    int before;     // how many tasks of its key were added earlier and are not finished
    int64_t due_ns; // do not run it before; 0: at once
    bool runs;
};

struct task_pool {
    int thread_count, nice;
    pthread_t *threads;
    pthread_mutex_t lock; // guards what follows; not held while a task runs
    pthread_cond_t wake;
    enum pool_state state;
    bool joined;
    int room[2];                // for tasks, for urgent tasks
    struct pool_entry *entries; // all
    struct pool_entry *unused;
    struct pool_entry *first, **end;
};

// ---- the list -----------------------------------------------------------------------------------

static void append(struct task_pool *pool, const struct pool_task *task) {
    struct pool_entry *entry = pool->unused;
    pool->unused = entry->next;
    *entry = (struct pool_entry){.task = *task};
    for (const struct pool_entry *e = pool->first; e; e = e->next)
        entry->before += task->key && e->task.key == task->key;
    *pool->end = entry;
    pool->end = &entry->next;
    pool->room[task->urgent]--;
}

static void drop(struct task_pool *pool, struct pool_entry *entry) {
    struct pool_entry **at = &pool->first;
    while (*at != entry)
        at = &(*at)->next;
    *at = entry->next;
    if (pool->end == &entry->next)
        pool->end = at;
    for (struct pool_entry *e = entry->next; e; e = e->next)
        e->before -= entry->task.key && e->task.key == entry->task.key;
    pool->room[entry->task.urgent]++;
    entry->next = pool->unused;
    pool->unused = entry;
}

// NULL: none can run now, and *out_due_ns says when one can (INT64_MAX: not by waiting alone).
static struct pool_entry *next_to_run(const struct task_pool *pool, int64_t *out_due_ns) {
    struct pool_entry *next = NULL;
    int64_t now_ns = clock_now_ns();
    *out_due_ns = INT64_MAX;
    if (pool->state == STOPPED)
        return NULL;
    for (struct pool_entry *e = pool->first; e; e = e->next) {
        if (e->runs || e->before)
            continue;
        if (pool->state == OPEN && e->due_ns > now_ns)
            *out_due_ns = e->due_ns < *out_due_ns ? e->due_ns : *out_due_ns;
        else if (!next || (e->task.urgent && !next->task.urgent))
            next = e;
    }
    return next;
}

// ---- threads ------------------------------------------------------------------------------------

static void finish(struct pool_task *task, bool done) {
    if (task->finish)
        task->finish(task->data, done);
}

// Called and returns with the lock held.
static void run(struct task_pool *pool, struct pool_entry *entry) {
    struct pool_task task = entry->task;
    entry->runs = true;
    pthread_mutex_unlock(&pool->lock);
    int64_t again_ns = task.run(task.data);
    CHECK(again_ns >= 0);
    pthread_mutex_lock(&pool->lock);
    if (again_ns != TASK_DONE && pool->state == OPEN) {
        entry->due_ns = clock_now_ns() + again_ns;
        entry->runs = false;
        pthread_cond_broadcast(&pool->wake); // those that wait have a time to wait for
        return;
    }
    pthread_mutex_unlock(&pool->lock);
    finish(&task, again_ns == TASK_DONE);
    pthread_mutex_lock(&pool->lock);
    drop(pool, entry); // if that lets one of its key run, this thread is free for it
}

static void wait_until(struct task_pool *pool, int64_t due_ns) {
    struct timespec due = {due_ns / NS_PER_S, due_ns % NS_PER_S};
    if (due_ns == INT64_MAX)
        pthread_cond_wait(&pool->wake, &pool->lock);
    else
        pthread_cond_timedwait(&pool->wake, &pool->lock, &due);
}

static void *serve(void *argument) {
    struct task_pool *pool = argument;
    if (pool->nice)
        setpriority(PRIO_PROCESS, (id_t)gettid(), pool->nice);
    pthread_mutex_lock(&pool->lock);
    for (;;) {
        int64_t due_ns;
        struct pool_entry *entry = next_to_run(pool, &due_ns);
        if (entry)
            run(pool, entry);
        else if (pool->state == OPEN)
            wait_until(pool, due_ns);
        else
            break;
    }
    pthread_mutex_unlock(&pool->lock);
    return NULL;
}

// ---- life ---------------------------------------------------------------------------------------

static void start_threads(struct task_pool *pool) {
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    for (int i = 0; i < pool->thread_count; i++)
        NEED(pthread_create(&pool->threads[i], NULL, serve, pool) == 0, "thread");
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

struct task_pool *task_pool_create(const struct task_pool_settings *settings) {
    CHECK(settings->threads > 0 && settings->tasks_max >= 0 && settings->urgent_max >= 0);
    struct task_pool *pool = alloc(1, sizeof *pool);
    pthread_condattr_t monotonic;
    int count = settings->tasks_max + settings->urgent_max;
    pool->thread_count = settings->threads;
    pool->threads = alloc((size_t)settings->threads, sizeof *pool->threads);
    pool->nice = settings->nice;
    pool->room[false] = settings->tasks_max;
    pool->room[true] = settings->urgent_max;
    pool->entries = alloc((size_t)count, sizeof *pool->entries);
    for (int i = 0; i < count; i++) {
        pool->entries[i].next = pool->unused;
        pool->unused = &pool->entries[i];
    }
    pool->end = &pool->first;
    pthread_mutex_init(&pool->lock, NULL);
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&pool->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    start_threads(pool);
    return pool;
}

bool task_pool_add(struct task_pool *pool, const struct pool_task *task) {
    pthread_mutex_lock(&pool->lock);
    bool taken = pool->state == OPEN && pool->room[task->urgent] > 0;
    if (taken) {
        append(pool, task);
        pthread_cond_signal(&pool->wake);
    }
    pthread_mutex_unlock(&pool->lock);
    return taken;
}

static void close_pool(struct task_pool *pool, enum pool_state state) {
    if (pool->joined)
        return;
    pthread_mutex_lock(&pool->lock);
    pool->state = state;
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->lock);
    for (int i = 0; i < pool->thread_count; i++)
        pthread_join(pool->threads[i], NULL);
    pool->joined = true;
}

void task_pool_stop(struct task_pool *pool) {
    close_pool(pool, STOPPED);
    for (struct pool_task task; pool->first; finish(&task, false)) {
        task = pool->first->task;
        drop(pool, pool->first);
    }
}

void task_pool_drain(struct task_pool *pool) {
    close_pool(pool, DRAINING);
}

void task_pool_destroy(struct task_pool **pool) {
    struct task_pool *p = *pool;
    if (!p)
        return;
    task_pool_stop(p);
    pthread_cond_destroy(&p->wake);
    pthread_mutex_destroy(&p->lock);
    free(p->entries);
    free(p->threads);
    free(p);
    *pool = NULL;
}
