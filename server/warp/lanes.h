// Arithmetic on WIDE doubles at once: 2, 4 or 8, as wide as the registers of a CPU level are. The
// including file says which. Lanes do not touch each other, so their bits do not depend on WIDE.
#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define LANES_INLINE static inline __attribute__((always_inline))

typedef double wide __attribute__((vector_size(WIDE * sizeof(double))));
typedef int64_t wide_mask __attribute__((vector_size(WIDE * sizeof(int64_t))));

LANES_INLINE wide wide_load(const double *from) {
    wide out;
    memcpy(&out, from, sizeof out);
    return out;
}

LANES_INLINE void wide_store(double *to, wide value) {
    memcpy(to, &value, sizeof value);
}

LANES_INLINE void wide_add(double *sum, wide value) {
    wide_store(sum, wide_load(sum) + value);
}

LANES_INLINE wide wide_of(double value) {
    wide zero = {0};
    return zero + value;
}

LANES_INLINE wide wide_choose(wide_mask mask, wide yes, wide no) {
    return (wide)((mask & (wide_mask)yes) | (~mask & (wide_mask)no));
}

LANES_INLINE wide wide_dot(const wide a[3], const wide b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

LANES_INLINE void wide_cross(const wide a[3], const wide b[3], wide out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

LANES_INLINE wide wide_root(wide a) {
    wide out;
    for (int i = 0; i < WIDE; i++)
        out[i] = sqrt(a[i]);
    return out;
}

LANES_INLINE bool wide_any(wide_mask mask) {
    int64_t all = 0;
    for (int i = 0; i < WIDE; i++)
        all |= mask[i];
    return all != 0;
}

// 0 up to a = 0, 1 from a = 1 on: a² (3 − 2a); and its derivative.
LANES_INLINE wide wide_ramp(wide a, wide *out_slope) {
    a = wide_choose(a > 0.0, a, wide_of(0));
    a = wide_choose(a < 1.0, a, wide_of(1));
    *out_slope = 6 * a * (1 - a);
    return a * a * (3 - 2 * a);
}

// The angle of (x, y), y > 0, from 0 to π, to the last digits; arctangent by the polynomial of
// FreeBSD's msun, on ±tan(π/8).
LANES_INLINE wide wide_angle(wide x, wide y) {
    static const double c[] = {
        3.33333333333329318027e-01,  -1.99999999998764832476e-01, 1.42857142725034663711e-01,
        -1.11111104054623557880e-01, 9.09088713343650656196e-02,  -7.69187620504482999495e-02,
        6.66107313738753120669e-02,  -5.83357013379057348645e-02, 4.97687799461593236017e-02,
        -3.65315727442169155270e-02, 1.62858201153657823623e-02};
    wide size = wide_choose(x < 0.0, -x, x);
    wide_mask steep = y > size;
    wide low = wide_choose(steep, size, y), high = wide_choose(steep, y, size);
    wide_mask middling = low > 0.41421356237309503 * high;
    wide a = wide_choose(middling, low - high, low) / wide_choose(middling, low + high, high);
    wide square = a * a, sum = wide_of(c[10]);
    for (int i = 9; i >= 0; i--)
        sum = sum * square + c[i];
    wide angle = a - a * square * sum;
    angle = wide_choose(middling, 0.78539816339744828 + angle, angle);
    angle = wide_choose(steep, 1.5707963267948966 - angle, angle);
    return wide_choose(x < 0.0, 3.1415926535897931 - angle, angle);
}
