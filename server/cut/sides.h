// Sides of triangles by their two ends: a hash table that is kept from cut to cut.
#pragma once

#include "cut/array.h"

struct side_entry {
    uint32_t from, to; // UINT32_MAX: nothing is here
    uint32_t side : 31;
    uint32_t living : 1; // for link.c: of a triangle that stays
};

struct side_table {
    struct side_entry *at;
    uint32_t room, mask;
};

void sides_clear(struct side_table *table, uint32_t count); // count: how many it must hold
void sides_fini(struct side_table *table);

static inline bool sides_is_here(const struct side_entry *entry) {
    return entry->from != UINT32_MAX;
}

// The entry from one vertex to another, or where it would be.
static inline struct side_entry *sides_place(const struct side_table *table, uint32_t from,
                                             uint32_t to) {
    uint64_t mixed = (((uint64_t)from << 32) | to) * UINT64_C(0x9e3779b97f4a7c15);
    uint32_t i = (uint32_t)(mixed >> 32) & table->mask;
    while (sides_is_here(&table->at[i]) && (table->at[i].from != from || table->at[i].to != to))
        i = (i + 1) & table->mask;
    return &table->at[i];
}

static inline bool sides_has(const struct side_table *table, uint32_t from, uint32_t to) {
    return sides_is_here(sides_place(table, from, to));
}

// false where it is there already.
static inline bool sides_enter(struct side_table *table, struct side_entry entry) {
    struct side_entry *place = sides_place(table, entry.from, entry.to);
    if (sides_is_here(place))
        return false;
    *place = entry;
    return true;
}
