#if defined(__x86_64__)

#define WIDE 4
#define WIDE_TARGET __attribute__((target("avx2")))
#include "warp/surface_walk_lanes.h"

WIDE_TARGET void surface_walk_avx2(struct walk *walk) {
    walk_all(walk);
}

#endif
