#if defined(__x86_64__)

#define WIDE 8
#define WIDE_TARGET __attribute__((target("avx512f,avx512dq")))
#include "warp/surface_walk_lanes.h"

WIDE_TARGET void surface_walk_avx512(struct walk *walk) {
    walk_all(walk);
}

#endif
