// A set of ids with a number for each, which is emptied at once by a new stamp.
#pragma once

#include "cut/array.h"

struct stamped_set {
    struct stamp {
        uint32_t epoch, value; // in the set where the epoch is the set's
    } * at;
    uint32_t room, epoch;
};

void stamped_set_fini(struct stamped_set *set);
void stamped_set_begin(struct stamped_set *set, uint32_t bound); // empties it, for ids below bound
void stamped_set_reserve(struct stamped_set *set, uint32_t bound); // for ids below it, keeps all

static inline bool stamped_set_has(const struct stamped_set *set, uint32_t id) {
    return set->at[id].epoch == set->epoch;
}

static inline uint32_t stamped_set_get(const struct stamped_set *set, uint32_t id) {
    return set->at[id].value;
}

static inline void stamped_set_put(struct stamped_set *set, uint32_t id, uint32_t value) {
    set->at[id] = (struct stamp){set->epoch, value};
}

static inline void stamped_set_remove(struct stamped_set *set, uint32_t id) {
    set->at[id].epoch = 0;
}
