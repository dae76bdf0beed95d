#include "metrics/hands.h"

#include "metrics/smooth.h"

#include <string.h>

void hands_init(struct hands *h) {
    memset(h, 0, sizeof *h);
}

static int several(uint8_t moving) {
    return (moving & (moving - 1)) != 0;
}

void hands_move(struct hands *h, int instrument, int64_t cell, double speed_mm_s) {
    int place = (int)(cell % HANDS_WINDOW);
    if (cell < h->cells[place])
        return;
    if (cell > h->cells[place]) {
        h->one += h->moving[place] != 0;
        h->two += several(h->moving[place]);
        h->cells[place] = cell;
        h->moving[place] = 0;
    }
    if (speed_mm_s > HANDS_MOVING_MM_S)
        h->moving[place] |= (uint8_t)(1 << instrument);
}

static int64_t count(const struct hands *h, int64_t *out_two) {
    int64_t one = h->one;
    *out_two = h->two;
    for (int i = 0; i < HANDS_WINDOW; i++) {
        one += h->moving[i] != 0;
        *out_two += several(h->moving[i]);
    }
    return one;
}

double hands_together(const struct hands *h) {
    int64_t two, one = count(h, &two);
    return one ? (double)two / (double)one : NAN;
}

double hands_seconds(const struct hands *h) {
    int64_t two;
    return (double)count(h, &two) / SMOOTH_RATE_HZ;
}
