// A line of any length in at most THIN_POINTS points: the way is cut into cells of equal time, and
// each keeps its extremes of both coordinates and its first point, so no peak is lost.
#pragma once

#include <stddef.h>

#define THIN_CELLS 333
#define THIN_KEPT 5
#define THIN_POINTS (THIN_CELLS * (THIN_KEPT + 1)) // one more where a line breaks

struct thin_point {
    double order, x, y;
};

struct thin {
    struct thin_cell {
        int count; // 0: nothing is here
        struct thin_point kept[THIN_KEPT];
        double broken; // where the line broke last; NaN: nowhere
    } cells[THIN_CELLS];
};

void thin_init(struct thin *thin);

// `order` rises from call to call, and lies from 0 to 1.
void thin_add(struct thin *thin, double order, double x, double y);
void thin_break(struct thin *thin, double order); // the next point is not joined to the last

// In order, NaN where the line breaks; how many.
size_t thin_points(const struct thin *thin, double out_x[THIN_POINTS], double out_y[THIN_POINTS]);
