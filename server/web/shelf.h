// Packed files, for those who ask for the same ones: whole classes open the same case. Bounded:
// what was asked for least lately makes room. From any threads.
#pragma once

#include <stddef.h>
#include <stdint.h>

#define SHELF_NAME_MAX 704
#define SHELF_BYTES (64 << 20)

struct shelf;

struct shelf *shelf_create(size_t most);  // bytes in all
void shelf_destroy(struct shelf **shelf); // what was taken lives on

struct packed {
    const uint8_t *bytes;
    size_t size;
};

// What is there of this name, or NULL; to be released.
const struct packed *shelf_take(struct shelf *shelf, const char *name);

// Keeps the bytes (of malloc, the shelf's from now on) where there is room for them, in the place
// of what had the name; they are taken, too.
const struct packed *shelf_put(struct shelf *shelf, const char *name, uint8_t *bytes, size_t size);

void packed_release(const struct packed **packed); // NULL inside is fine; *packed becomes NULL
