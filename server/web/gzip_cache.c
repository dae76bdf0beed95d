#include "web/gzip_cache.h"

#include "base/check.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct cached_file {
    struct gzip_file packed;  // first: a pointer to it is a pointer to the item
    atomic_int holders;       // the cache too
    struct cached_file *next; // asked for less lately
    char name[GZIP_CACHE_NAME_MAX];
};

struct gzip_cache {
    pthread_mutex_t lock;
    size_t most, used;
    struct cached_file *first;
};

struct gzip_cache *gzip_cache_create(size_t most) {
    struct gzip_cache *cache = alloc(1, sizeof *cache);
    cache->most = most;
    pthread_mutex_init(&cache->lock, NULL);
    return cache;
}

void gzip_file_release(const struct gzip_file **packed) {
    struct cached_file *item = (struct cached_file *)(uintptr_t)*packed;
    *packed = NULL;
    if (!item || atomic_fetch_sub(&item->holders, 1) > 1)
        return;
    free((void *)(uintptr_t)item->packed.bytes);
    free(item);
}

// Takes it out of the row; the cache's hold on it stays.
static struct cached_file *pick(struct gzip_cache *s, struct cached_file **at) {
    struct cached_file *item = *at;
    *at = item->next;
    s->used -= item->packed.size;
    return item;
}

static void put_first(struct gzip_cache *s, struct cached_file *item) {
    item->next = s->first;
    s->first = item;
    s->used += item->packed.size;
}

static struct cached_file *pick_named(struct gzip_cache *s, const char *name) {
    for (struct cached_file **at = &s->first; *at; at = &(*at)->next)
        if (!strcmp((*at)->name, name))
            return pick(s, at);
    return NULL;
}

static void drop(struct cached_file *item) {
    const struct gzip_file *packed = item ? &item->packed : NULL;
    gzip_file_release(&packed);
}

static void drop_last(struct gzip_cache *s) {
    struct cached_file **at = &s->first;
    while ((*at)->next)
        at = &(*at)->next;
    drop(pick(s, at));
}

void gzip_cache_destroy(struct gzip_cache **cache) {
    struct gzip_cache *s = *cache;
    while (s->first)
        drop_last(s);
    pthread_mutex_destroy(&s->lock);
    free(s);
    *cache = NULL;
}

const struct gzip_file *gzip_cache_take(struct gzip_cache *s, const char *name) {
    pthread_mutex_lock(&s->lock);
    struct cached_file *item = pick_named(s, name);
    if (item) {
        put_first(s, item);
        atomic_fetch_add(&item->holders, 1);
    }
    pthread_mutex_unlock(&s->lock);
    return item ? &item->packed : NULL;
}

const struct gzip_file *gzip_cache_put(struct gzip_cache *s, const char *name, uint8_t *bytes,
                                       size_t size) {
    struct cached_file *item = alloc(1, sizeof *item);
    CHECK(snprintf(item->name, sizeof item->name, "%s", name) < GZIP_CACHE_NAME_MAX);
    item->packed = (struct gzip_file){bytes, size};
    atomic_init(&item->holders, 1);
    pthread_mutex_lock(&s->lock);
    drop(pick_named(s, name));
    if (size <= s->most) {
        atomic_fetch_add(&item->holders, 1);
        put_first(s, item);
    }
    while (s->used > s->most)
        drop_last(s);
    pthread_mutex_unlock(&s->lock);
    return &item->packed;
}
