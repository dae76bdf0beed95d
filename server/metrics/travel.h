// How far and how smoothly a point moved, from its smoothed positions (metrics/smooth.h).
//
// A path is measured with a ruler: from where it begins, the first point of the path at the ruler's
// length is the next mark, and so on; its length is the marks' distances and what is left past the
// last one. Noise much smaller than the ruler adds nothing, however long the point rests.
//
// Jerk j is the third difference of smoothed positions over (10 ms)³, speed v their first over 10
// ms. With T the time over which there is jerk:
//
//     LDLJ = −ln(T³ / max|v|² · Σ |j|² · 10 ms)
#pragma once

#include "metrics/smooth.h"

#define TRAVEL_RULER_MM 0.5
#define TRAVEL_LONG_RULER_MM 10.0

struct ruler {
    double mm;
    bool begun;
    vec3 mark, last;
    double marked_mm;
};

void ruler_init(struct ruler *ruler, double mm);
void ruler_break(struct ruler *ruler); // the next point begins another path, added to this one
void ruler_add(struct ruler *ruler, vec3 point);
double ruler_length(const struct ruler *ruler);

struct travel {
    struct ruler path, economy;
    vec3 before[3]; // the last points of this run, the newest first
    int count;
    double speed;         // mm/s, between the last two; 0 where there is one
    double largest_speed; // where there is jerk
    double jerk_squared;  // Σ |j|², mm²/s⁶
    int64_t jerks;        // how many
};

void travel_init(struct travel *travel);
void travel_add(struct travel *travel, const struct smooth_point *point);

double travel_path_mm(const struct travel *travel);
// The path with the long ruler over that with the short one: near 1 for straight ways. NaN where
// the path is shorter than the long ruler.
double travel_economy(const struct travel *travel);
double travel_ldlj(const struct travel *travel); // NaN where nothing moved
double travel_jerk(const struct travel *travel); // root mean square, mm/s³; 0 where there is none

// The root mean square jerk that noise of 0.1 mm in each direction, of so many samples a second,
// leaves behind the filter: 258 mm/s³ at 100.
double travel_noise_jerk(double rate_hz);
