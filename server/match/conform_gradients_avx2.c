#if defined(__x86_64__)

#include "match/conform_gradients.h"

__attribute__((target("avx2"))) void conform_gradients_avx2(struct conform *c, const vec3 *right,
                                                            double energy, vec3 *out) {
    solve(c, right, energy, out);
}

#endif
