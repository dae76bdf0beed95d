#include "motion/tremor.h"

#include "motion/dice.h"

#define TURN (2 * 3.14159265358979323846)

void tremor_init(struct tremor *tremor, double rms_mm, uint64_t seed) {
    // A wave of amplitude a has a mean square of a² / 2, and there are 3 TREMOR_WAVES of them.
    tremor->amplitude = rms_mm * sqrt(2.0 / (3 * TREMOR_WAVES));
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < TREMOR_WAVES; i++) {
            tremor->frequency[axis][i] = 8 + 4 * dice_share(&seed);
            tremor->phase[axis][i] = TURN * dice_share(&seed);
        }
}

vec3 tremor_at(const struct tremor *tremor, double t_seconds) {
    double sum[3] = {0};
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < TREMOR_WAVES; i++)
            sum[axis] +=
                sin(TURN * tremor->frequency[axis][i] * t_seconds + tremor->phase[axis][i]);
    return vec3_scale(tremor->amplitude, (vec3){sum[0], sum[1], sum[2]});
}
