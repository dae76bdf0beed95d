// Arrays that grow and are kept, and marks on ids that are forgotten all at once.
#pragma once

#include "base/check.h"

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

// A number for some ids.
struct marks {
    struct mark {
        uint32_t epoch, value;
    } * at;
    uint32_t room, epoch;
};

void marks_fini(struct marks *marks);
void marks_begin(struct marks *marks, uint32_t bound);   // no id below `bound` has a number
void marks_reserve(struct marks *marks, uint32_t bound); // as marks_begin, but nothing is forgotten

static inline bool marks_has(const struct marks *marks, uint32_t id) {
    return marks->at[id].epoch == marks->epoch;
}

static inline uint32_t marks_get(const struct marks *marks, uint32_t id) {
    return marks->at[id].value;
}

static inline void marks_set(struct marks *marks, uint32_t id, uint32_t value) {
    marks->at[id] = (struct mark){marks->epoch, value};
}

static inline void marks_unset(struct marks *marks, uint32_t id) {
    marks->at[id].epoch = 0;
}
