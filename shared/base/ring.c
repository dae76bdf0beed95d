#include "base/ring.h"

#include "base/check.h"

#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

struct ring {
    size_t capacity, item_size;
    _Alignas(64) atomic_size_t head; // next to write, owned by the producer
    _Alignas(64) atomic_size_t tail; // next to read, owned by the consumer
    _Alignas(64) uint8_t items[];
};

struct ring *ring_create(size_t capacity, size_t item_size) {
    CHECK(capacity && (capacity & (capacity - 1)) == 0 && item_size);
    struct ring *ring = alloc_aligned(64, sizeof *ring + capacity * item_size);
    memset(ring, 0, sizeof *ring); // no item is touched before it is used
    ring->capacity = capacity;
    ring->item_size = item_size;
    return ring;
}

void ring_destroy(struct ring **ring) {
    free(*ring);
    *ring = NULL;
}

static void *slot(struct ring *ring, size_t index) {
    return ring->items + (index & (ring->capacity - 1)) * ring->item_size;
}

bool ring_push(struct ring *ring, const void *item) {
    size_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
    if (head - tail == ring->capacity)
        return false;
    memcpy(slot(ring, head), item, ring->item_size);
    atomic_store_explicit(&ring->head, head + 1, memory_order_release);
    return true;
}

size_t ring_count(const struct ring *ring) {
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    return atomic_load_explicit(&ring->head, memory_order_acquire) - tail;
}

bool ring_pop(struct ring *ring, void *out_item) {
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    size_t head = atomic_load_explicit(&ring->head, memory_order_acquire);
    if (head == tail)
        return false;
    memcpy(out_item, slot(ring, tail), ring->item_size);
    atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
    return true;
}
