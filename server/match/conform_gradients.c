#include "match/conform_gradients.h"

void conform_gradients_plain(struct conform *c, const vec3 *right, vec3 *out) {
    solve(c, right, out);
}

#if defined(__x86_64__)

void conform_solve(struct conform *c, const vec3 *right, vec3 *out) {
    (__builtin_cpu_supports("avx2") ? conform_gradients_avx2 : conform_gradients_plain)(c, right,
                                                                                        out);
}

#else

void conform_solve(struct conform *c, const vec3 *right, vec3 *out) {
    conform_gradients_plain(c, right, out);
}

#endif
