#include "calibrate/encoder.h"

#include <math.h>

static double mean_of(const double *numbers, int count) {
    double sum = 0;
    for (int i = 0; i < count; i++)
        sum += numbers[i];
    return sum / count;
}

static void measure_encoder(const double *readings, const double *values, int count,
                            struct encoder_fit *fit) {
    double sum = 0;
    fit->max = 0;
    for (int i = 0; i < count; i++) {
        double off = fabs(fit->scale * readings[i] + fit->offset - values[i]);
        sum += off * off;
        fit->max = fmax(fit->max, off);
    }
    fit->rms = sqrt(sum / count);
}

enum result encoder_calibrate(const double *readings, const double *values, int count,
                              struct encoder_fit *out, struct error *err) {
    if (count < 2)
        return fail(err, RESULT_MISSING, "%d known values are too few, at least 2 are needed",
                    count);
    double mean_reading = mean_of(readings, count), mean_value = mean_of(values, count);
    double spread = 0, both = 0, low = readings[0], high = readings[0];
    for (int i = 0; i < count; i++) {
        double reading = readings[i] - mean_reading;
        spread += reading * reading;
        both += reading * (values[i] - mean_value);
        low = fmin(low, readings[i]);
        high = fmax(high, readings[i]);
    }
    if (!(high - low >= ENCODER_COUNTS_MIN) || !isfinite(both))
        return fail(err, RESULT_INVALID,
                    "the encoder's readings lie between %g and %g, less than %.0f counts apart. "
                    "Check register and encoder",
                    low, high, ENCODER_COUNTS_MIN);
    struct encoder_fit fit = {.scale = both / spread};
    fit.offset = mean_value - fit.scale * mean_reading;
    measure_encoder(readings, values, count, &fit);
    *out = fit;
    return RESULT_OK;
}
