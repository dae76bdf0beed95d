#include "relay/lookup.h"

#include "base/check.h"

#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>

static void look_up(struct lookup *lookup, int flags) {
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = flags}, *found = NULL;
    if (getaddrinfo(lookup->host, NULL, &hints, &found))
        return;
    for (struct addrinfo *at = found; at && lookup->count < LOOKUP_ADDRESSES_MAX; at = at->ai_next)
        lookup->count += !getnameinfo(at->ai_addr, at->ai_addrlen, lookup->addresses[lookup->count],
                                      sizeof *lookup->addresses, NULL, 0, NI_NUMERICHOST);
    freeaddrinfo(found);
}

static int64_t run(void *data) {
    look_up(data, AI_ADDRCONFIG);
    return TASK_DONE;
}

static void finish(void *data, bool done) {
    struct lookup *lookup = data;
    (void)done;
    atomic_store(&lookup->done, true);
    lookup_release(&lookup);
}

struct lookup *lookup_begin(struct task_pool *pool, const char *host) {
    struct lookup *lookup = alloc(1, sizeof *lookup);
    struct pool_task task = {.run = run, .finish = finish, .data = lookup};
    atomic_init(&lookup->references, 2);
    snprintf(lookup->host, sizeof lookup->host, "%s", host);
    look_up(lookup, AI_NUMERICHOST);
    if (lookup->count || !task_pool_add(pool, &task)) {
        atomic_store(&lookup->references, 1);
        atomic_store(&lookup->done, true);
    }
    return lookup;
}

void lookup_release(struct lookup **lookup) {
    struct lookup *l = *lookup;
    *lookup = NULL;
    if (l && atomic_fetch_sub(&l->references, 1) == 1)
        free(l);
}
