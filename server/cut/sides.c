#include "cut/sides.h"

#include <stdlib.h>
#include <string.h>

void sides_clear(struct side_table *table, uint32_t count) {
    uint32_t size = 64;
    while (size < count + count / 2)
        size *= 2;
    table->at = array_grow(table->at, &table->room, size, sizeof *table->at);
    table->mask = size - 1;
    memset(table->at, 0xff, size * sizeof *table->at);
}

void sides_fini(struct side_table *table) {
    free(table->at);
    *table = (struct side_table){0};
}
