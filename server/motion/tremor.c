#include "motion/tremor.h"

#define TURN (2 * 3.14159265358979323846)

// splitmix64, as a number from 0 to 1
static double next(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

void tremor_init(struct tremor *tremor, double rms_mm, uint64_t seed) {
    // A wave of amplitude a has a mean square of a² / 2, and there are 3 TREMOR_WAVES of them.
    tremor->amplitude = rms_mm * sqrt(2.0 / (3 * TREMOR_WAVES));
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < TREMOR_WAVES; i++) {
            tremor->frequency[axis][i] = 8 + 4 * next(&seed);
            tremor->phase[axis][i] = TURN * next(&seed);
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
