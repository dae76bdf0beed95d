#include "cut/array.h"

#include <stdlib.h>
#include <string.h>

void *array_grow(void *memory, uint32_t *room, uint32_t need, size_t size) {
    if (need <= *room)
        return memory;
    CHECK(need < UINT32_MAX / 2);
    *room = need < 32 ? 64 : 2 * need;
    return alloc_resize(memory, *room, size);
}

void *array_copy(const void *memory, size_t count, size_t size) {
    return count ? memcpy(alloc(count, size), memory, count * size) : NULL;
}

void ids_fini(struct ids *ids) {
    free(ids->at);
    *ids = (struct ids){0};
}

struct ids ids_copy(const struct ids *ids) {
    return (struct ids){array_copy(ids->at, ids->count, sizeof *ids->at), ids->count, ids->count};
}

static int compare_ids(const void *a, const void *b) {
    uint32_t i = *(const uint32_t *)a, k = *(const uint32_t *)b;
    return i < k ? -1 : i > k;
}

void ids_sort(struct ids *ids) {
    if (ids->count)
        qsort(ids->at, ids->count, sizeof *ids->at, compare_ids);
}

void marks_fini(struct marks *marks) {
    free(marks->at);
    *marks = (struct marks){0};
}

void marks_reserve(struct marks *marks, uint32_t bound) {
    uint32_t before = marks->room;
    marks->at = array_grow(marks->at, &marks->room, bound, sizeof *marks->at);
    if (marks->room > before)
        memset(marks->at + before, 0, (marks->room - before) * sizeof *marks->at);
}

void marks_begin(struct marks *marks, uint32_t bound) {
    marks_reserve(marks, bound);
    CHECK(++marks->epoch);
}
