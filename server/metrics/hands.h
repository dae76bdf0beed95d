// The work of both hands: the time in which two or more instruments move, divided by the time in
// which at least one moves. An instrument moves if its smoothed speed is above HANDS_MOVING_MM_S.
#pragma once

#include <stdint.h>

#define HANDS_MOVING_MM_S 5.0
#define HANDS_WINDOW 64 // cells; the most by which one instrument's samples are behind another's

struct hands {
    int64_t cells[HANDS_WINDOW];  // the cell of each element of `moving`
    uint8_t moving[HANDS_WINDOW]; // a bit for each instrument
    int64_t one, two; // earlier cells in which at least one, and at least two, instruments moved
};

void hands_init(struct hands *hands);
void hands_move(struct hands *hands, int instrument, int64_t cell, double speed_mm_s);
double hands_together(const struct hands *hands); // NaN if none moved
double hands_seconds(const struct hands *hands);  // in which at least one moved
