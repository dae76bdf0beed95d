#include "matrices.h"
#include "scene/world.h"
#include "test.h"

static struct field with_skin(double skin_mm) {
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    field.skin_mm = skin_mm;
    return field;
}

// What the header says of φ, and of the skin that a gap leaves, once more.
static double effective(double d, double skin, double gap) {
    double u = gap / (26 * skin);
    double s = u < 2 ? skin * (u - u * u / 4) : skin;
    return d <= s ? 0 : d <= 2 * s ? (d - s) * (d - s) / (2 * s) : d - 1.5 * s;
}

static void within_the_skin_noise_makes_no_error(void **state) {
    (void)state;
    struct random r = {1};
    struct world w;
    world_create(&w, &r, true);
    struct field field = with_skin(0.1);
    int touched = 0;
    for (int i = 0; i < 2000; i++) {
        world_place(&w, &r, i % 2);
        int surface = i % w.scene.surface_count;
        vec3 on = world_point_on(&w, surface, &r);
        vec3 y = vec3_add_scaled(on, random_between(&r, 0, 0.0999), random_direction(&r));
        if (world_clearance(&w, surface, y) < 5.2)
            continue;
        struct closest c = world_contact(&w.scene, surface, y);
        struct warp warp = world_warp(&w.scene, &field, y);
        assert_vec3_near(warp.displacement, warp_of_contact(&w.scene, surface, &c), 0);
        assert_true(warp.nearest_mm == c.distance);
        touched++;
    }
    assert_true(touched > 400);
    world_fini(&w);
}

// Walls at z = ±gap/2, the lower one displaced by 3 mm along z.
static double between_walls(double gap, double skin, double z, struct warp *out) {
    static struct bodies walls;
    static double made_gap = -1;
    if (made_gap != gap) {
        bodies_fini(&walls);
        bodies_walls(&walls, gap, 3);
        made_gap = gap;
    }
    pose B = pose_identity();
    struct warp_scene scene = {walls.surfaces, walls.count, &B, NULL};
    struct field field = with_skin(skin);
    *out = world_warp(&scene, &field, (vec3){0.3, 0.2, z});
    return out->displacement.z;
}

static void between_walls_the_warp_is_that_of_the_thinned_distances(void **state) {
    (void)state;
    const struct field field = field_default(FIELD_INVERSE_DISTANCE);
    const double R = field.radius_mm, w0 = field.background_per_mm;
    const double gaps[] = {0.05, 0.3, 1, 3, 20}, skin = 0.1, reach = R + 1.5 * skin;
    for (int g = 0; g < 5; g++)
        for (int i = 1; i < 200; i++) {
            double d1 = gaps[g] * i / 200, d2 = gaps[g] - d1;
            bool in_reach[2] = {d1 <= reach, d2 <= reach};
            double gap = in_reach[0] && in_reach[1] ? gaps[g] : INFINITY;
            double e1 = effective(d1, skin, gap), e2 = effective(d2, skin, gap);
            double w1 = in_reach[0] ? fmax(0, 1 / e1 - 1 / R) : 0;
            double w2 = in_reach[1] ? fmax(0, 1 / e2 - 1 / R) : 0;
            double expected = e1 <= 1e-6 ? 3 : e2 <= 1e-6 ? 0 : 3 * w1 / (w1 + w2 + w0);
            struct warp warp;
            assert_near(between_walls(gaps[g], skin, d1 - gaps[g] / 2, &warp), expected, 1e-5);
        }
}

// However narrow, down to skins that would meet: the gain stays within twice the least possible,
// rise / gap, of which the field without a skin has about one.
static void in_a_narrow_gap_the_skin_gives_way(void **state) {
    (void)state;
    const double gaps[] = {0.01, 0.05, 0.2, 0.5, 1, 1.6, 2.5};
    for (int g = 0; g < 7; g++) {
        double gap = gaps[g], before = 3, largest = 0;
        for (int i = 1; i < 1000; i++) {
            struct warp warp;
            double W = between_walls(gap, 0.1, gap * (i / 1000.0 - 0.5), &warp);
            largest = fmax(largest, fabs(W - before) / (gap / 1000));
            before = W;
        }
        print_message("gap %g mm: gain %.3g of the least possible\n", gap, largest / (3 / gap));
        assert_true(largest < 2 * 3 / gap);
    }
}

static void the_gradient_with_a_skin_agrees_with_central_differences(void **state) {
    (void)state;
    struct random r = {2};
    struct world w;
    world_create(&w, &r, true);
    const double h = 1e-6;
    int agree = 0, count = 0, thinned = 0;
    for (int i = 0; i < 3000; i++) {
        world_place(&w, &r, i % 2);
        struct field field = with_skin(random_between(&r, 0.01, 0.5));
        vec3 near = vec3_add_scaled(world_point_on(&w, i % 5, &r), random_between(&r, 0, 0.6),
                                    random_direction(&r));
        vec3 y = i % 3 ? near : world_somewhere(&r), axis = random_direction(&r);
        struct warp warp = world_warp(&w.scene, &field, y);
        vec3 ahead = world_warp(&w.scene, &field, vec3_add_scaled(y, h, axis)).displacement;
        vec3 behind = world_warp(&w.scene, &field, vec3_add_scaled(y, -h, axis)).displacement;
        vec3 slope = vec3_scale(0.5 / h, vec3_sub(ahead, behind));
        agree += vec3_distance(slope, mat3_apply(warp.gradient, axis)) <
                 1e-4 * (1 + mat3_norm(warp.gradient));
        thinned += world_clearance(&w, warp.nearest, y) + warp.nearest_mm < 52 * field.skin_mm;
        count++;
    }
    print_message("%d of %d agree, %d in gaps\n", agree, count, thinned);
    assert_true(agree > 0.98 * count && thinned > 100);
    world_fini(&w);
}

// A skin changes nothing but distances: far from everything, little.
static void beyond_the_radius_and_the_skin_there_is_no_warp(void **state) {
    (void)state;
    struct warp warp;
    double edge = -20 + field_default(FIELD_INVERSE_DISTANCE).radius_mm + 1.5 * 0.1;
    assert_near(between_walls(40, 0.1, edge - 1e-9, &warp), 0, 1e-8);
    assert_near(between_walls(40, 0.1, edge + 1e-9, &warp), 0, 0);
    assert_true(between_walls(40, 0.1, edge - 0.05, &warp) > 1e-3);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(within_the_skin_noise_makes_no_error),
        cmocka_unit_test(between_walls_the_warp_is_that_of_the_thinned_distances),
        cmocka_unit_test(in_a_narrow_gap_the_skin_gives_way),
        cmocka_unit_test(the_gradient_with_a_skin_agrees_with_central_differences),
        cmocka_unit_test(beyond_the_radius_and_the_skin_there_is_no_warp),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
