#include "web/rate_limits.h"

#include "base/check.h"
#include "base/clock.h"

#include <arpa/inet.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#define ADDRESSES_MAX 1024 // more than connections, to remember addresses after they disconnect

struct rate_limit {
    bool known;
    struct in6_addr address;
    int connections;
    struct bucket requests;
    int64_t left_ns;
};

struct rate_limits {
    int connections;
    struct rate_limit limits[ADDRESSES_MAX];
};

_Static_assert(ADDRESSES_MAX > WEB_CONNECTIONS_MAX, "there is always one without a connection");

bool bucket_take(struct bucket *bucket, double per_s, double most, int64_t now_ns) {
    double back = per_s * (double)(now_ns - bucket->checked_ns) / (double)NS_PER_S;
    bucket->spent = back < bucket->spent ? bucket->spent - back : 0;
    bucket->checked_ns = now_ns;
    if (bucket->spent + 1 > most)
        return false;
    bucket->spent += 1;
    return true;
}

struct rate_limits *rate_limits_create(void) {
    return alloc(1, sizeof(struct rate_limits));
}

void rate_limits_destroy(struct rate_limits **limits) {
    free(*limits);
    *limits = NULL;
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
static struct rate_limit *find_place(struct rate_limits *limits) {
    struct rate_limit *best = NULL;
    for (int i = 0; i < ADDRESSES_MAX; i++) {
        struct rate_limit *limit = &limits->limits[i];
        if (limit->connections == 0 && (!best || limit->left_ns < best->left_ns))
            best = limit;
    }
    return best;
}

struct rate_limit *rate_limits_find(struct rate_limits *limits, int fd) {
    struct in6_addr address;
    if (!read_address(fd, &address))
        return NULL;
    for (int i = 0; i < ADDRESSES_MAX; i++) {
        struct rate_limit *limit = &limits->limits[i];
        if (limit->known && !memcmp(&limit->address, &address, sizeof address))
            return limit;
    }
    struct rate_limit *limit = find_place(limits);
    *limit = (struct rate_limit){.known = true, .address = address};
    return limit;
}

bool rate_limit_may_connect(const struct rate_limits *limits, const struct rate_limit *limit) {
    return limits->connections < WEB_CONNECTIONS_MAX &&
           limit->connections < WEB_CONNECTIONS_PER_ADDRESS;
}

void rate_limit_connected(struct rate_limits *limits, struct rate_limit *limit) {
    limits->connections++;
    limit->connections++;
}

void rate_limit_disconnected(struct rate_limits *limits, struct rate_limit *limit) {
    limits->connections--;
    limit->connections--;
    limit->left_ns = clock_now_ns();
}

bool rate_limit_may_request(struct rate_limit *limit, int64_t now_ns) {
    return bucket_take(&limit->requests, WEB_REQUESTS_PER_S, WEB_REQUESTS_BURST, now_ns);
}
