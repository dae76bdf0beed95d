#include "web/rate_limits.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/source.h"

#include <stdlib.h>

#define ADDRESSES_MAX 1024 // more than connections, to remember addresses after they disconnect

struct rate_limit {
    bool known;
    struct source source;
    int connections;
    struct bucket requests;
    int64_t left_ns;
};

struct rate_limits {
    int connections;
    struct rate_limit limits[ADDRESSES_MAX];
};

_Static_assert(ADDRESSES_MAX > WEB_CONNECTIONS_MAX, "there is always one without a connection");

struct rate_limits *rate_limits_create(void) {
    return alloc(1, sizeof(struct rate_limits));
}

void rate_limits_destroy(struct rate_limits **limits) {
    free(*limits);
    *limits = NULL;
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
    struct source source;
    if (!source_of(fd, &source))
        return NULL;
    for (int i = 0; i < ADDRESSES_MAX; i++) {
        struct rate_limit *limit = &limits->limits[i];
        if (limit->known && source_is(&limit->source, &source))
            return limit;
    }
    struct rate_limit *limit = find_place(limits);
    *limit = (struct rate_limit){.known = true, .source = source};
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
