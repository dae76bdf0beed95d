// Passes the newest of a stream of values from one thread to another. Neither side ever waits. A
// value that is not taken before the next one is put is lost.
#pragma once

#include <stdbool.h>
#include <stddef.h>

struct newest;

struct newest *newest_create(size_t item_size);
void newest_destroy(struct newest **newest); // NULL inside is fine; *newest becomes NULL

// Producer. Copies the item in. True where the item before was taken: the consumer may be asleep.
bool newest_put(struct newest *newest, const void *item);

// Consumer. Copies the newest item out; false where there is none since the last one.
bool newest_take(struct newest *newest, void *out_item);
