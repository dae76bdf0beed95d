// A bounded queue of fixed-size items between one producer thread and one consumer thread.
// Neither side ever waits: a full ring refuses, an empty one has nothing.
#pragma once

#include <stdbool.h>
#include <stddef.h>

struct ring;

// `capacity` items (a power of two) of `item_size` bytes each.
struct ring *ring_create(size_t capacity, size_t item_size);
void ring_destroy(struct ring **ring); // NULL inside is fine; *ring becomes NULL

// Producer. Copies the item in; false when full.
bool ring_push(struct ring *ring, const void *item);

// Consumer: how many items there are; more may come meanwhile, none goes. For other threads it is
// an estimate.
size_t ring_count(const struct ring *ring);

// Consumer. Copies the oldest item out; false when empty.
bool ring_pop(struct ring *ring, void *out_item);
