#include "lease_world.h"

#include "base/check.h"

static bool is_before(const struct happening *a, const struct happening *b) {
    return a->at_ns != b->at_ns ? a->at_ns < b->at_ns : a->number < b->number;
}

void put(struct world *w, struct happening event) {
    event.number = ++w->numbers;
    if (w->count == w->room) {
        w->room = w->room ? 2 * w->room : 1024;
        w->heap = alloc_resize(w->heap, w->room, sizeof *w->heap);
    }
    size_t i = w->count++;
    while (i && is_before(&event, &w->heap[(i - 1) / 2])) {
        w->heap[i] = w->heap[(i - 1) / 2];
        i = (i - 1) / 2;
    }
    w->heap[i] = event;
}

struct happening take_first(struct world *w) {
    struct happening first = w->heap[0], last = w->heap[--w->count];
    size_t i = 0;
    for (size_t child; (child = 2 * i + 1) < w->count; i = child) {
        if (child + 1 < w->count && is_before(&w->heap[child + 1], &w->heap[child]))
            child++;
        if (!is_before(&w->heap[child], &last))
            break;
        w->heap[i] = w->heap[child];
    }
    w->heap[i] = last;
    return first;
}

int64_t delay(struct world *w) {
    bool slow = w->now_ns < w->trouble_ns && happens(w, 0.02);
    return seconds(slow ? random_between(&w->random, 0.1, 6)
                        : random_between(&w->random, 0.001, 0.02));
}

bool is_lost(struct world *w) {
    return w->now_ns < w->trouble_ns && happens(w, 0.02);
}
