#if defined(__x86_64__)

#define WIDE 8
#define WIDE_TARGET __attribute__((target("avx2")))
#include "match/soup_walk.h"

WIDE_TARGET void soup_walk_avx2(struct looking *s) {
    walk(s);
}

#endif
