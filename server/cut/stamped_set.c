#include "cut/stamped_set.h"

#include <stdlib.h>
#include <string.h>

void stamped_set_fini(struct stamped_set *set) {
    free(set->at);
    *set = (struct stamped_set){0};
}

void stamped_set_reserve(struct stamped_set *set, uint32_t bound) {
    uint32_t before = set->room;
    set->at = array_grow(set->at, &set->room, bound, sizeof *set->at);
    if (set->room > before)
        memset(set->at + before, 0, (set->room - before) * sizeof *set->at);
}

void stamped_set_begin(struct stamped_set *set, uint32_t bound) {
    stamped_set_reserve(set, bound);
    CHECK(++set->epoch);
}
