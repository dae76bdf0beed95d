#include "cut/sides.h"

#include <stdlib.h>
#include <string.h>

void sides_clear(struct side_table *table, uint32_t count) {
    uint32_t size = 64;
    while (size < 2 * count)
        size *= 2;
    uint32_t before = table->room;
    table->at = array_grow(table->at, &table->room, size, sizeof *table->at);
    if (table->room > before)
        memset(table->at + before, 0, (table->room - before) * sizeof *table->at);
    table->mask = size - 1;
    CHECK(++table->epoch < UINT32_C(1) << 31);
}

void sides_fini(struct side_table *table) {
    free(table->at);
    *table = (struct side_table){0};
}
