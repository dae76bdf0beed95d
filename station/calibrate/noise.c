#include "calibrate/noise.h"

double noise_of_points(const vec3 *points, int count) {
    double sum = 0;
    for (int i = 2; i < count; i++) {
        vec3 second = vec3_add_scaled(vec3_add(points[i], points[i - 2]), -2, points[i - 1]);
        sum += vec3_dot(second, second);
    }
    return count < 3 ? 0 : sqrt(sum / (3 * 6.0 * (count - 2)));
}
