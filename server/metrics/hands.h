// Whether two hands work together: how long two or more instruments move at the same time, of the
// time in which any does. An instrument moves where its smoothed speed is above HANDS_MOVING_MM_S.
#pragma once

#include <stdint.h>

#define HANDS_MOVING_MM_S 5.0
#define HANDS_WINDOW 64 // cells; instruments' samples are not late by more than that

struct hands {
    int64_t cells[HANDS_WINDOW]; // that a place of `moving` is about
    uint8_t moving[HANDS_WINDOW];
    int64_t one, two; // cells before those: with any moving, and with two or more
};

void hands_init(struct hands *hands);
void hands_move(struct hands *hands, int instrument, int64_t cell, double speed_mm_s);
double hands_together(const struct hands *hands); // NaN where none moved
double hands_seconds(const struct hands *hands);  // in which any moved
