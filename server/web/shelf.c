#include "web/shelf.h"

#include "base/check.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct item {
    struct packed packed; // first: what is taken is this
    atomic_int holders;   // the shelf too
    struct item *next;    // asked for less lately
    char name[SHELF_NAME_MAX];
};

struct shelf {
    pthread_mutex_t lock;
    size_t most, used;
    struct item *first;
};

struct shelf *shelf_create(size_t most) {
    struct shelf *shelf = alloc(1, sizeof *shelf);
    shelf->most = most;
    pthread_mutex_init(&shelf->lock, NULL);
    return shelf;
}

void packed_release(const struct packed **packed) {
    struct item *item = (struct item *)(uintptr_t)*packed;
    *packed = NULL;
    if (!item || atomic_fetch_sub(&item->holders, 1) > 1)
        return;
    free((void *)(uintptr_t)item->packed.bytes);
    free(item);
}

// Takes it out of the row; the shelf's hold on it stays.
static struct item *pick(struct shelf *s, struct item **at) {
    struct item *item = *at;
    *at = item->next;
    s->used -= item->packed.size;
    return item;
}

static void put_first(struct shelf *s, struct item *item) {
    item->next = s->first;
    s->first = item;
    s->used += item->packed.size;
}

static struct item *pick_named(struct shelf *s, const char *name) {
    for (struct item **at = &s->first; *at; at = &(*at)->next)
        if (!strcmp((*at)->name, name))
            return pick(s, at);
    return NULL;
}

static void drop(struct item *item) {
    const struct packed *packed = item ? &item->packed : NULL;
    packed_release(&packed);
}

static void drop_last(struct shelf *s) {
    struct item **at = &s->first;
    while ((*at)->next)
        at = &(*at)->next;
    drop(pick(s, at));
}

void shelf_destroy(struct shelf **shelf) {
    struct shelf *s = *shelf;
    while (s->first)
        drop_last(s);
    pthread_mutex_destroy(&s->lock);
    free(s);
    *shelf = NULL;
}

const struct packed *shelf_take(struct shelf *s, const char *name) {
    pthread_mutex_lock(&s->lock);
    struct item *item = pick_named(s, name);
    if (item) {
        put_first(s, item);
        atomic_fetch_add(&item->holders, 1);
    }
    pthread_mutex_unlock(&s->lock);
    return item ? &item->packed : NULL;
}

const struct packed *shelf_put(struct shelf *s, const char *name, uint8_t *bytes, size_t size) {
    struct item *item = alloc(1, sizeof *item);
    CHECK(snprintf(item->name, sizeof item->name, "%s", name) < SHELF_NAME_MAX);
    item->packed = (struct packed){bytes, size};
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
