// The quartiles of a course's curve: of the first attempts of all trainees, of the second ones, and
// so on. A quantile lies between two figures as in Hyndman, Fan, The American Statistician
// 50:361-365 (1996), definition 7: at 1 + (n - 1) p of the sorted figures.
#pragma once

struct quartiles {
    int count;                // trainees who made this attempt
    double low, middle, high; // 0.25, 0.5, 0.75; NAN where count is below `least`
};

// The quantile of `count` >= 1 figures, sorted upwards. share: 0 to 1.
double sorted_quantile(const double *figures, int count, double share);

// figures: those of trainee i, in the order of the attempts, at starts[i] to starts[i + 1] - 1.
// Fills `attempts` entries of out. least: below this number of trainees there are no quartiles, so
// that nobody sees another one's figures; at least 1.
void quartile_curve(const double *figures, const int *starts, int trainees, int attempts, int least,
                    struct quartiles *out);
