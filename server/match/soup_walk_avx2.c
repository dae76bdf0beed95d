#if defined(__x86_64__)

#pragma GCC target("avx2")
#define WIDE 8
#include "match/soup_walk.h"

void soup_walk_avx2(struct looking *s) {
    walk(s);
}

#endif
