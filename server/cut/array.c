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
    return count ? memcpy(alloc_resize(NULL, count, size), memory, count * size) : NULL;
}

void ids_fini(struct ids *ids) {
    free(ids->at);
    *ids = (struct ids){0};
}

struct ids ids_copy(const struct ids *ids) {
    return (struct ids){array_copy(ids->at, ids->count, sizeof *ids->at), ids->count, ids->count};
}

static void sort_few(uint32_t *at, uint32_t count) {
    for (uint32_t i = 1; i < count; i++) {
        uint32_t id = at[i], k = i;
        for (; k > 0 && at[k - 1] > id; k--)
            at[k] = at[k - 1];
        at[k] = id;
    }
}

#define DIGIT_BITS 8
#define DIGITS (1 << DIGIT_BITS)

static void sort_by_digit(const uint32_t *from, uint32_t *to, uint32_t count, int shift) {
    uint32_t starts[DIGITS] = {0}, sum = 0;
    for (uint32_t i = 0; i < count; i++)
        starts[from[i] >> shift & (DIGITS - 1)]++;
    for (uint32_t d = 0; d < DIGITS; d++) {
        uint32_t start = sum;
        sum += starts[d];
        starts[d] = start;
    }
    for (uint32_t i = 0; i < count; i++)
        to[starts[from[i] >> shift & (DIGITS - 1)]++] = from[i];
}

// By digits, the upper half of the array as room to sort into and back.
void ids_sort(struct ids *ids) {
    uint32_t count = ids->count, highest = 0;
    if (count < 64) {
        sort_few(ids->at, count);
        return;
    }
    ids->at = array_grow(ids->at, &ids->room, 2 * count, sizeof *ids->at);
    for (uint32_t i = 0; i < count; i++)
        highest = ids->at[i] > highest ? ids->at[i] : highest;
    uint32_t *from = ids->at, *to = ids->at + count;
    for (int shift = 0; shift < 32 && highest >> shift; shift += DIGIT_BITS) {
        sort_by_digit(from, to, count, shift);
        uint32_t *swap = from;
        from = to;
        to = swap;
    }
    if (from != ids->at)
        memcpy(ids->at, from, count * sizeof *from);
}
