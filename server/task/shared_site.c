#include "task/shared_site.h"

#include "base/check.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

struct shared_site {
    struct site_pool *pool;
    struct shared_site *next;
    int users;
    const struct scene *scene;
    struct task_file file;
    struct site *site;
};

// The lock is held while a site is made: two sessions that want the same one make it once.
struct site_pool {
    pthread_mutex_t lock;
    struct shared_site *first;
};

struct site_pool *site_pool_create(void) {
    struct site_pool *pool = alloc(1, sizeof *pool);
    pthread_mutex_init(&pool->lock, NULL);
    return pool;
}

void site_pool_destroy(struct site_pool **pool) {
    if (!*pool)
        return;
    CHECK(!(*pool)->first);
    pthread_mutex_destroy(&(*pool)->lock);
    free(*pool);
    *pool = NULL;
}

static bool is_for(const struct shared_site *s, const struct task_file *file,
                   const struct scene *scene, const struct instruments *tools,
                   const struct view_optic *optic) {
    const struct view_optic *own = site_optic(s->site);
    return s->scene == scene && s->file.size == file->size &&
           !memcmp(s->file.text, file->text, file->size) &&
           !strcmp(s->file.task.name, file->task.name) &&
           instruments_equal(site_tools(s->site), tools) && own->tilt_deg == optic->tilt_deg &&
           own->field_deg == optic->field_deg;
}

static enum result make(struct site_pool *pool, const struct task_file *file,
                        const struct scene *scene, const struct instruments *tools,
                        const struct view_optic *optic, struct shared_site **out,
                        struct error *err) {
    struct shared_site *s = alloc(1, sizeof *s);
    s->pool = pool;
    s->scene = scene;
    s->file = *file;
    enum result result = site_create(&s->file.task, scene, tools, optic, &s->site, err);
    if (result != RESULT_OK) {
        free(s);
        return result;
    }
    s->next = pool->first;
    pool->first = s;
    *out = s;
    return RESULT_OK;
}

enum result shared_site_take(struct site_pool *pool, const struct task_file *file,
                             const struct scene *scene, const struct instruments *tools,
                             const struct view_optic *optic, struct shared_site **out,
                             struct error *err) {
    enum result result = RESULT_OK;
    pthread_mutex_lock(&pool->lock);
    struct shared_site *s = pool->first;
    while (s && !is_for(s, file, scene, tools, optic))
        s = s->next;
    if (!s)
        result = make(pool, file, scene, tools, optic, &s, err);
    if (result == RESULT_OK) {
        s->users++;
        *out = s;
    }
    pthread_mutex_unlock(&pool->lock);
    return result;
}

void shared_site_release(struct shared_site **site) {
    struct shared_site *s = *site;
    *site = NULL;
    if (!s)
        return;
    struct site_pool *pool = s->pool;
    pthread_mutex_lock(&pool->lock);
    bool unused = --s->users == 0;
    struct shared_site **at = &pool->first;
    while (unused && *at != s)
        at = &(*at)->next;
    if (unused)
        *at = s->next;
    pthread_mutex_unlock(&pool->lock);
    if (!unused)
        return;
    site_destroy(&s->site);
    free(s);
}

const struct site *shared_site_site(const struct shared_site *s) {
    return s->site;
}

const struct task_file *shared_site_file(const struct shared_site *s) {
    return &s->file;
}
