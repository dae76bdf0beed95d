// The addresses of a host, looked up on another thread where that may take time.
#pragma once

#include "base/task_pool.h"

#include <stdatomic.h>

#define LOOKUP_ADDRESSES_MAX 4

struct lookup {
    atomic_int references;
    char host[128];
    atomic_bool done; // all below stays as it is from then on
    int count;        // 0: the host is not known
    char addresses[LOOKUP_ADDRESSES_MAX][48];
};

// Is done at once for an address, and never fails: what cannot be looked up is not known.
struct lookup *lookup_begin(struct task_pool *pool, const char *host);
void lookup_release(struct lookup **lookup); // NULL inside is fine
