#include "web/guests.h"

#include "base/check.h"
#include "base/clock.h"

#include <arpa/inet.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#define GUESTS_MAX 1024 // more than connections: who is gone is remembered for a while

struct guest {
    bool known;
    struct in6_addr address;
    int connections;
    struct bucket requests;
    int64_t left_ns;
};

struct guests {
    int connections;
    struct guest guests[GUESTS_MAX];
};

_Static_assert(GUESTS_MAX > GUESTS_CONNECTIONS_MAX, "there is always one without a connection");

bool bucket_take(struct bucket *bucket, double per_s, double most, int64_t now_ns) {
    double back = per_s * (double)(now_ns - bucket->checked_ns) / (double)NS_PER_S;
    bucket->spent = back < bucket->spent ? bucket->spent - back : 0;
    bucket->checked_ns = now_ns;
    if (bucket->spent + 1 > most)
        return false;
    bucket->spent += 1;
    return true;
}

struct guests *guests_create(void) {
    return alloc(1, sizeof(struct guests));
}

void guests_destroy(struct guests **guests) {
    free(*guests);
    *guests = NULL;
}

static bool read_address(int fd, struct in6_addr *out) {
    struct sockaddr_storage address = {0};
    socklen_t size = sizeof address;
    if (getpeername(fd, (struct sockaddr *)&address, &size))
        return false;
    memset(out, 0, sizeof *out);
    if (address.ss_family == AF_INET) {
        memset(out->s6_addr + 10, 0xff, 2);
        memcpy(out->s6_addr + 12, &((const struct sockaddr_in *)&address)->sin_addr, 4);
    } else if (address.ss_family == AF_INET6) {
        *out = ((const struct sockaddr_in6 *)&address)->sin6_addr;
        if (!IN6_IS_ADDR_V4MAPPED(out))
            memset(out->s6_addr + 8, 0, 8);
    }
    return true;
}

// The one that was gone longest; one that was never used before any other.
static struct guest *find_place(struct guests *guests) {
    struct guest *best = NULL;
    for (int i = 0; i < GUESTS_MAX; i++) {
        struct guest *guest = &guests->guests[i];
        if (guest->connections == 0 && (!best || guest->left_ns < best->left_ns))
            best = guest;
    }
    return best;
}

struct guest *guests_find(struct guests *guests, int fd) {
    struct in6_addr address;
    if (!read_address(fd, &address))
        return NULL;
    for (int i = 0; i < GUESTS_MAX; i++) {
        struct guest *guest = &guests->guests[i];
        if (guest->known && !memcmp(&guest->address, &address, sizeof address))
            return guest;
    }
    struct guest *guest = find_place(guests);
    *guest = (struct guest){.known = true, .address = address};
    return guest;
}

bool guest_may_connect(const struct guests *guests, const struct guest *guest) {
    return guests->connections < GUESTS_CONNECTIONS_MAX &&
           guest->connections < GUESTS_CONNECTIONS_EACH;
}

void guest_connected(struct guests *guests, struct guest *guest) {
    guests->connections++;
    guest->connections++;
}

void guest_gone(struct guests *guests, struct guest *guest) {
    guests->connections--;
    guest->connections--;
    guest->left_ns = clock_now_ns();
}

bool guest_may_ask(struct guest *guest, int64_t now_ns) {
    return bucket_take(&guest->requests, GUESTS_REQUESTS_S, GUESTS_REQUESTS_AT_ONCE, now_ns);
}
