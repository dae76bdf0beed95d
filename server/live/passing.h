// What another server tells, on its way to a page of this one: encoded items, which are not decoded
// but for what names a station. Each server counts the stations of its own config, so their numbers
// are written anew. No thread and no clock.
#pragma once

#include "wire/live.h"

#define PASSING_CHUNK 5  // the tag of mesh_chunk in Live
#define PASSING_GROWTH 3 // how many times as large a batch can become

// Stations of the other server by its numbers.
struct passing_numbers {
    int count;
    int *own; // the number here; -1: not told yet, or not in the config here
};

struct passing {
    struct passing_numbers *numbers;
    void *user;
    // Its number here, or -1. `likely`: the number that it had when last asked, or -1.
    int (*find)(void *user, const char *station, int likely);
    // An item: its tag in Live, and the number here of the station that it is about, or -1. False:
    // it is left out.
    bool (*wanted)(void *user, uint32_t kind, int station);
    void (*reply)(void *user, const uint8_t *item, size_t size); // a command_reply
    arthron_Why_Code why;                                        // of the last Trouble
};

// Writes what the page is to get: at most PASSING_GROWTH * size bytes. False: it is no batch.
bool passing_take(struct passing *passing, const uint8_t *batch, size_t size, uint8_t *out,
                  size_t *out_size);

// The first item of encoded ones: its size with all that goes before it; 0: there is none.
size_t passing_first(const uint8_t *items, size_t size, uint32_t *out_kind);

// The answer to LIST, an encoded item: of stations that other servers have the rows of `other`, the
// item of such a server. Returns the size; 0: there is no room, or either is none.
size_t passing_merge(const uint8_t *own, size_t own_size, const uint8_t *other, size_t other_size,
                     uint8_t *out, size_t room);
