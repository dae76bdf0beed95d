#include "warp/surface_walk.h"

#define WIDE 2 // every processor that we know has as much
#define WIDE_TARGET
#include "warp/surface_walk_lanes.h"

void surface_walk_plain(struct walk *walk) {
    walk_all(walk);
}

#if defined(__x86_64__)

enum walk_level surface_walk_best(void) {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
        return WALK_AVX512;
    return __builtin_cpu_supports("avx2") ? WALK_AVX2 : WALK_PLAIN;
}

void surface_walk(struct walk *walk, enum walk_level level) {
    static void (*const walks[WALK_LEVELS])(struct walk *) = {[WALK_PLAIN] = surface_walk_plain,
                                                              [WALK_AVX2] = surface_walk_avx2,
                                                              [WALK_AVX512] = surface_walk_avx512};
    walks[level](walk);
}

#else

enum walk_level surface_walk_best(void) {
    return WALK_PLAIN;
}

void surface_walk(struct walk *walk, enum walk_level level) {
    (void)level;
    surface_walk_plain(walk);
}

#endif
