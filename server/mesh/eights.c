#include "mesh/eights.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

struct splitter {
    const float *middles; // 3 for each point
    uint32_t random;      // pivots are drawn: rows of equal or sorted points take no longer
};

static int widest_axis(const struct splitter *s, const struct eights_item *items, uint32_t count) {
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < count; i++)
        for (int axis = 0; axis < 3; axis++) {
            float value = s->middles[3 * (size_t)items[i].number + (size_t)axis];
            low[axis] = value < low[axis] ? value : low[axis];
            high[axis] = value > high[axis] ? value : high[axis];
        }
    int widest = 0;
    for (int axis = 1; axis < 3; axis++)
        if (high[axis] - low[axis] > high[widest] - low[widest])
            widest = axis;
    return widest;
}

static bool is_before(struct eights_item a, struct eights_item b) {
    return a.at != b.at ? a.at < b.at : a.number < b.number;
}

static void exchange(struct eights_item *a, struct eights_item *b) {
    struct eights_item kept = *a;
    *a = *b;
    *b = kept;
}

// Brings the `left` first of them to the front (Hoare 1961).
static void part(struct splitter *s, struct eights_item *items, uint32_t count, uint32_t left) {
    uint32_t from = 0, to = count; // the first of the others lies there
    while (to - from > 1) {
        s->random = s->random * 1664525 + 1013904223;
        exchange(&items[from + s->random % (to - from)], &items[to - 1]);
        uint32_t before = from;
        for (uint32_t i = from; i + 1 < to; i++)
            if (is_before(items[i], items[to - 1]))
                exchange(&items[i], &items[before++]);
        exchange(&items[before], &items[to - 1]);
        if (before == left)
            return;
        *(before < left ? &from : &to) = before < left ? before + 1 : before;
    }
}

// What is left of a half so that all before it fill their boxes.
static uint32_t left_of(uint32_t count) {
    uint64_t size = EIGHT;
    while (size * EIGHT < count)
        size *= EIGHT;
    return (uint32_t)((count + size - 1) / size / 2 * size);
}

// Halves along the widest axis.
static void split(struct splitter *s, struct eights_item *items, uint32_t count) {
    if (count <= EIGHT)
        return;
    int axis = widest_axis(s, items, count);
    for (uint32_t i = 0; i < count; i++)
        items[i].at = s->middles[3 * (size_t)items[i].number + (size_t)axis];
    uint32_t left = left_of(count);
    part(s, items, count, left);
    split(s, items, left);
    split(s, items + left, count - left);
}

void eights_order(const float *middles, uint32_t count, struct eights_item *out_items) {
    struct splitter splitter = {middles, 1};
    for (uint32_t i = 0; i < count; i++)
        out_items[i] = (struct eights_item){0, i};
    split(&splitter, out_items, count);
}
