#include "web/rate_limits.h"

#include "base/check.h"

#include <stdlib.h>

#define ADDRESSES_MAX 1024 // more than connections, to remember addresses after they disconnect

struct rate_limits {
    struct rate_limit limits[ADDRESSES_MAX];
};

_Static_assert(ADDRESSES_MAX > 2 * WEB_CONNECTIONS_MAX, "there is always one without a connection");

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
        if (limit->ends == 0 && (!best || limit->left_ns < best->left_ns))
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

bool rate_limit_may_request(struct rate_limit *limit, bool has_token, int64_t now_ns) {
    struct bucket *bucket = has_token ? &limit->proofs : &limit->requests;
    return bucket_take(bucket, WEB_REQUESTS_PER_S, WEB_REQUESTS_BURST, now_ns);
}
