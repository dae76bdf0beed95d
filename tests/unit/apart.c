#include "step/apart.h"

#include "mesh/query.h"
#include "random.h"
#include "scene/shapes.h"
#include "test.h"

static double by_brute_force(const struct mesh *mesh, const vec3 *points, uint32_t count) {
    double largest = 0;
    for (uint32_t i = 0; i < count; i++) {
        double nearest = INFINITY;
        for (uint32_t t = 0; t < mesh->triangle_count; t++) {
            struct closest closest;
            closest_on_triangle(mesh, t, points[i], &closest);
            nearest = fmin(nearest, closest.distance);
        }
        largest = fmax(largest, nearest);
    }
    return largest;
}

static void the_largest_distance_is_exact_near_and_far(void **state) {
    (void)state;
    struct random r = {6};
    struct mesh sphere;
    shape_sphere(&sphere, 6, 10);
    for (int i = 0; i < 200; i++) {
        vec3 points[33], at = vec3_scale(6, random_direction(&r));
        double spread = (double[]){0.01, 0.3, 3, 40}[i % 4];
        uint32_t count = 1 + (uint32_t)(random_bits(&r) % 33);
        for (uint32_t k = 0; k < count; k++)
            points[k] = vec3_add(at, random_in_box(&r, spread));
        assert_true(apart_mm(&sphere, points, count) == by_brute_force(&sphere, points, count));
    }
    assert_true(apart_mm(&sphere, NULL, 0) == 0);
    mesh_fini(&sphere);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_largest_distance_is_exact_near_and_far),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
