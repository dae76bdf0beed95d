// Recorded hands, as they are and with noise, at several rates: which of their poses are taken for
// those of a source that shakes?
#pragma once

#define NOISE_ROWS 56 // 7 recordings at 8 rates

struct noise_row {
    const char *file;
    double rate_hz;
    double clean, noisy; // shares of the poses; noisy: with a standard deviation of 2 mm
};

// Of the recordings in the folder `data`/tracker. Returns how many rows; 0: they are not there.
int noise_table(const char *data, struct noise_row out_rows[NOISE_ROWS]);
