// How far and how smoothly a point moved, from its smoothed positions (metrics/smooth.h).
//
// A path is measured with a ruler. The first mark is where the path begins. The next mark is the
// first point at the ruler's length from the last mark. The path's length is the sum of the
// distances between marks, plus the rest after the last one. Noise much smaller than the ruler adds
// nothing while the point rests.
//
// Jerk j is the third difference of smoothed positions over (10 ms)³, and speed v is the first one
// over 10 ms. T is the time for which jerk is known:
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
    double speed;         // mm/s, between the last two; 0 if there is only one
    double largest_speed; // while jerk is known
    double jerk_squared;  // Σ |j|², mm²/s⁶
    int64_t jerks;        // number of terms in this sum
};

void travel_init(struct travel *travel);
void travel_add(struct travel *travel, const struct smooth_point *point);

double travel_path_mm(const struct travel *travel);
// The path with the long ruler over that with the short one: near 1 for straight ways. NaN where
// the path is shorter than the long ruler.
double travel_economy(const struct travel *travel);
double travel_ldlj(const struct travel *travel); // NaN where nothing moved
double travel_jerk(const struct travel *travel); // root mean square, mm/s³; 0 where there is none

// The root mean square jerk that noise of 0.1 mm in each direction has after the filter, at this
// rate of samples: 258 mm/s³ at 100 Hz.
double travel_noise_jerk(double rate_hz);
