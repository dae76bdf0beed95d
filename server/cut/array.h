// Arrays that grow and keep their memory.
#pragma once

#include "base/check.h"
#include "base/extremes.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Memory for at least `need` items: as it is, or moved and doubled. *room follows.
void *array_grow(void *memory, uint32_t *room, uint32_t need, size_t size);
void *array_copy(const void *memory, size_t count, size_t size); // NULL where the count is 0

struct ids {
    uint32_t *at;
    uint32_t count, room;
};

void ids_fini(struct ids *ids);
struct ids ids_copy(const struct ids *ids);
void ids_sort(struct ids *ids); // ascending

static inline void ids_push(struct ids *ids, uint32_t id) {
    if (ids->count == ids->room)
        ids->at = array_grow(ids->at, &ids->room, ids->count + 1, sizeof *ids->at);
    ids->at[ids->count++] = id;
}
