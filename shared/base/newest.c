#include "base/newest.h"

#include "base/check.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define FRESH 4u // beside the index: not taken yet

// Three places: one is the producer's, one the consumer's, the third is between them.
struct newest {
    size_t item_size;
    unsigned char *items;
    atomic_uint between;
    unsigned producers, consumers;
};

struct newest *newest_create(size_t item_size) {
    struct newest *newest = alloc(1, sizeof *newest);
    newest->item_size = item_size;
    newest->items = alloc(3, item_size);
    newest->producers = 1;
    newest->consumers = 2;
    return newest;
}

void newest_destroy(struct newest **newest) {
    if (!*newest)
        return;
    free((*newest)->items);
    free(*newest);
    *newest = NULL;
}

bool newest_put(struct newest *newest, const void *item) {
    memcpy(newest->items + newest->producers * newest->item_size, item, newest->item_size);
    unsigned before = atomic_exchange(&newest->between, newest->producers | FRESH);
    newest->producers = before & ~FRESH;
    return !(before & FRESH);
}

bool newest_take(struct newest *newest, void *out_item) {
    if (!(atomic_load(&newest->between) & FRESH))
        return false;
    newest->consumers = atomic_exchange(&newest->between, newest->consumers) & ~FRESH;
    memcpy(out_item, newest->items + newest->consumers * newest->item_size, newest->item_size);
    return true;
}
