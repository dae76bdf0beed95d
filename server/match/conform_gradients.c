#include "match/conform_gradients.h"

void conform_gradients_plain(struct conform *c, const vec3 *right, double energy, vec3 *out) {
    solve(c, right, energy, out);
}

void conform_solve(struct conform *c, const vec3 *right, double energy, vec3 *out) {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        conform_gradients_avx2(c, right, energy, out);
        return;
    }
#endif
    conform_gradients_plain(c, right, energy, out);
}
