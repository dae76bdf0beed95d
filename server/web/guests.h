// How much each address may take: connections, and requests over time. One thread.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define GUESTS_CONNECTIONS_MAX 256
#define GUESTS_CONNECTIONS_EACH 96
#define GUESTS_REQUESTS_S 40
#define GUESTS_REQUESTS_AT_ONCE 200

// Tokens that come back over time: a zeroed one is full.
struct bucket {
    double spent;
    int64_t checked_ns;
};

// Takes one of `most` tokens, of which `per_s` come back each second; false where none is left.
bool bucket_take(struct bucket *bucket, double per_s, double most, int64_t now_ns);

struct guests;
struct guest; // an IPv4 address, or an IPv6 network of 64 bits

struct guests *guests_create(void);
void guests_destroy(struct guests **guests); // *guests becomes NULL

// Who is at the other end of a socket. NULL where it has gone.
struct guest *guests_find(struct guests *guests, int fd);

// False where it, or all together, have as many connections as they may.
bool guest_may_connect(const struct guests *guests, const struct guest *guest);
void guest_connected(struct guests *guests, struct guest *guest);
void guest_gone(struct guests *guests, struct guest *guest);

bool guest_may_ask(struct guest *guest, int64_t now_ns);
