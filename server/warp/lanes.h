// Arithmetic on eight doubles at once. The compiler makes of it what the CPU level has; bits do not
// depend on that.
#pragma once

#include "warp/surface_blocks.h"

#include <math.h>

#define LANES_INLINE static inline __attribute__((always_inline))

LANES_INLINE lanes8 spread8(double value) {
    return (lanes8){value, value, value, value, value, value, value, value};
}

LANES_INLINE lanes8 choose8(mask8 mask, lanes8 yes, lanes8 no) {
    return (lanes8)((mask & (mask8)yes) | (~mask & (mask8)no));
}

LANES_INLINE lanes8 dot8(const lanes8 a[3], const lanes8 b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

LANES_INLINE void cross8(const lanes8 a[3], const lanes8 b[3], lanes8 out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

LANES_INLINE lanes8 root8(lanes8 a) {
    lanes8 out;
    for (int i = 0; i < BLOCK_LANES; i++)
        out[i] = sqrt(a[i]);
    return out;
}

LANES_INLINE bool any8(mask8 mask) {
    int64_t all = 0;
    for (int i = 0; i < BLOCK_LANES; i++)
        all |= mask[i];
    return all != 0;
}

// In a fixed order.
LANES_INLINE double sum8(lanes8 a) {
    return ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7]));
}

// 0 up to a = 0, 1 from a = 1 on: a² (3 − 2a); and its derivative.
LANES_INLINE lanes8 ramp8(lanes8 a, lanes8 *out_slope) {
    a = choose8(a > 0.0, a, spread8(0));
    a = choose8(a < 1.0, a, spread8(1));
    *out_slope = 6 * a * (1 - a);
    return a * a * (3 - 2 * a);
}

// The angle of (x, y), y > 0, from 0 to π, to the last digits; arctangent by the polynomial of
// FreeBSD's msun, on ±tan(π/8).
LANES_INLINE lanes8 angle8(lanes8 x, lanes8 y) {
    static const double c[] = {
        3.33333333333329318027e-01,  -1.99999999998764832476e-01, 1.42857142725034663711e-01,
        -1.11111104054623557880e-01, 9.09088713343650656196e-02,  -7.69187620504482999495e-02,
        6.66107313738753120669e-02,  -5.83357013379057348645e-02, 4.97687799461593236017e-02,
        -3.65315727442169155270e-02, 1.62858201153657823623e-02};
    lanes8 size = choose8(x < 0.0, -x, x);
    mask8 steep = y > size;
    lanes8 low = choose8(steep, size, y), high = choose8(steep, y, size);
    mask8 middling = low > 0.41421356237309503 * high;
    lanes8 a = choose8(middling, low - high, low) / choose8(middling, low + high, high);
    lanes8 square = a * a, sum = spread8(c[10]);
    for (int i = 9; i >= 0; i--)
        sum = sum * square + c[i];
    lanes8 angle = a - a * square * sum;
    angle = choose8(middling, 0.78539816339744828 + angle, angle);
    angle = choose8(steep, 1.5707963267948966 - angle, angle);
    return choose8(x < 0.0, 3.1415926535897931 - angle, angle);
}
