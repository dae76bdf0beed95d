// Overlaps and gaps of two groups, against closed forms and sampling.
#include "check/touch.h"
#include "random.h"
#include "scene/shapes.h"
#include "test.h"
#include "winding.h"

static const double pi = 3.14159265358979;

static pose moved(double x, double y, double z) {
    return (pose){{1, 0, 0, 0}, {x, y, z}};
}

static void prepare(struct touching *touching, struct mesh *mesh) {
    struct error err;
    assert_ok(touching_init(touching, mesh, &err));
    mesh_fini(mesh);
}

// The lens of two spheres.
static double lens_mm3(double r, double s, double d) {
    double depth = r + s - d;
    return pi * depth * depth * (d * d + 2 * d * (r + s) - 3 * (r - s) * (r - s)) / (12 * d);
}

static void two_spheres_overlap_as_a_lens(void **state) {
    (void)state;
    struct touching a, b;
    struct mesh mesh;
    shape_sphere(&mesh, 20, 48);
    prepare(&a, &mesh);
    shape_sphere(&mesh, 12, 40);
    prepare(&b, &mesh);
    vec3 way = vec3_unit_or((vec3){1, -2, 3}, (vec3){0});
    const double depths[] = {0.2, 1, 3, 9}, shares[] = {0.4, 0.08, 0.04, 0.04};
    for (int i = 0; i < 4; i++) {
        double d = 32 - depths[i];
        vec3 centre = vec3_scale(d, way);
        struct overlap found = overlap_of(&a, &b, (pose){{1, 0, 0, 0}, centre});
        assert_near(found.volume_mm3, lens_mm3(20, 12, d), shares[i] * lens_mm3(20, 12, d));
        assert_near(found.depth_mm, depths[i], 0.1);
        assert_true(vec3_length(found.place) < 20.01);
        assert_true(vec3_distance(found.place, centre) < 12.01);
    }
    assert_near(overlap_of(&a, &b, (pose){{1, 0, 0, 0}, vec3_scale(32.1, way)}).depth_mm, 0, 0);
    touching_fini(&a);
    touching_fini(&b);
}

static void boxes_overlap_as_a_box_also_where_no_corner_lies_inside(void **state) {
    (void)state;
    struct touching a, b;
    struct mesh mesh;
    shape_box(&mesh, (vec3){30, 4, 4});
    prepare(&a, &mesh);
    shape_box(&mesh, (vec3){5, 25, 4});
    prepare(&b, &mesh);
    struct overlap cross = overlap_of(&a, &b, moved(3, 2, 6.5));
    assert_near(cross.volume_mm3, 10 * 8 * 1.5, 6);
    assert_near(cross.depth_mm, 1.5, 0.1);
    assert_near(cross.place.z, 3.25, 0.9);
    struct overlap thin = overlap_of(&a, &b, moved(0, 0, 7.9));
    assert_near(thin.volume_mm3, 10 * 8 * 0.1, 0.8);
    assert_near(thin.depth_mm, 0.1, 0.02);
    struct overlap touch = overlap_of(&a, &b, moved(0, 0, 8.001));
    assert_near(touch.volume_mm3, 0, 0);
    assert_near(touch.depth_mm, 0, 0);
    touching_fini(&a);
    touching_fini(&b);
}

static void the_volume_of_any_overlap_is_that_of_random_places(void **state) {
    (void)state;
    struct random r = {7};
    struct mesh mesh_a, mesh_b, copy;
    shape_bumpy(&mesh_a, (vec3){14, 11, 9}, 1.5, 10, 3);
    shape_bumpy(&mesh_b, (vec3){10, 12, 8}, 1, 10, 4);
    struct touching a, b;
    mesh_copy(&copy, &mesh_a);
    prepare(&a, &copy);
    mesh_copy(&copy, &mesh_b);
    prepare(&b, &copy);
    for (int trial = 0; trial < 3; trial++) {
        pose T = {random_pose(&r, 1).rotation, random_in_box(&r, 8)};
        int inside = 0, count = 20000;
        double deepest = 0;
        for (int i = 0; i < count; i++) {
            struct touching_hints hints;
            vec3 p = random_in_box(&r, 17), on;
            touching_forget(&hints);
            if (!is_inside(&mesh_a, p) || !is_inside(&mesh_b, pose_apply_inverse(T, p)))
                continue;
            inside++;
            double of_a = -touching_distance(&a, p, &hints, &on);
            double of_b = -touching_distance(&b, pose_apply_inverse(T, p), &hints, &on);
            if (fmin(of_a, of_b) < 0.3)
                deepest = fmax(deepest, fmax(of_a, of_b));
        }
        double volume = 34.0 * 34 * 34 * inside / count;
        double error = 34.0 * 34 * 34 * sqrt(inside) / count;
        struct overlap found = overlap_of(&a, &b, T);
        assert_true(inside > 100);
        assert_near(found.volume_mm3, volume, 4 * error + 0.02 * volume);
        assert_true(found.depth_mm >= deepest - 0.3 && found.depth_mm < deepest + 1);
    }
    mesh_fini(&mesh_a);
    mesh_fini(&mesh_b);
    touching_fini(&a);
    touching_fini(&b);
}

// In cubes of 0.6 mm it would take minutes, and gigabytes.
static void a_ball_deep_in_a_large_one_is_measured_in_larger_cubes(void **state) {
    (void)state;
    struct touching a, b;
    struct mesh mesh;
    shape_sphere(&mesh, 1600, 64);
    prepare(&a, &mesh);
    shape_sphere(&mesh, 1200, 64);
    double ball_mm3 = mesh_volume(&mesh);
    prepare(&b, &mesh);
    struct overlap found = overlap_of(&a, &b, moved(0, 240, 0));
    assert_near(found.volume_mm3, ball_mm3, 0.01 * ball_mm3);
    assert_near(found.depth_mm, 1600 - 1200 + 240, 12);
    assert_near(found.place.y, 240 - 1200, 80);
    touching_fini(&a);
    touching_fini(&b);
}

// Bone, and cartilage that laps 0.1 mm over it or leaves 0.1 mm free: the depth goes through both.
static void cartilage_and_bone_are_one_solid(void **state) {
    (void)state;
    const double laps[] = {0.1, -0.1};
    for (int i = 0; i < 2; i++) {
        struct touching group, ball;
        struct mesh bone, cartilage, mesh;
        shape_box(&bone, (vec3){20, 20, 10});
        shape_box(&cartilage, (vec3){15, 15, 1.5});
        shape_move(&cartilage, moved(0, 0, 11.5 - laps[i]));
        shape_append(&bone, &cartilage);
        mesh_fini(&cartilage);
        prepare(&group, &bone);
        shape_sphere(&mesh, 8, 32);
        prepare(&ball, &mesh);
        double top = 13 - laps[i];
        struct overlap found = overlap_of(&group, &ball, moved(1, 2, top + 8 - 5.6));
        assert_near(found.depth_mm, 5.6, 0.2);
        touching_fini(&group);
        touching_fini(&ball);
    }
}

static void a_sheet_has_an_inside_behind_it_and_none_past_its_border(void **state) {
    (void)state;
    struct touching sheet, ball;
    struct mesh mesh;
    shape_grid(&mesh, 20, 20);
    prepare(&sheet, &mesh);
    shape_sphere(&mesh, 6, 24);
    prepare(&ball, &mesh);
    assert_near(overlap_of(&sheet, &ball, moved(0, 0, 4)).depth_mm, 2, 0.1);
    assert_near(overlap_of(&sheet, &ball, moved(0, 0, 6.5)).depth_mm, 0, 0);
    assert_near(overlap_of(&sheet, &ball, moved(29, 0, -3)).depth_mm, 0, 0);
    touching_fini(&sheet);
    touching_fini(&ball);
}

static void the_gap_is_where_two_surfaces_are_nearest(void **state) {
    (void)state;
    struct touching a, b;
    struct mesh mesh;
    shape_sphere(&mesh, 20, 40);
    prepare(&a, &mesh);
    shape_box(&mesh, (vec3){30, 30, 5});
    prepare(&b, &mesh);
    struct gap found = gap_of(&a, &b, moved(4, 3, -28));
    assert_near(found.mm, 3, 1e-4);
    assert_vec3_near(found.place, ((vec3){0, 0, -20}), 0.1);
    found = gap_of(&b, &a, moved(-4, -3, 28));
    assert_near(found.mm, 3, 1e-4);
    assert_vec3_near(found.place, ((vec3){-4, -3, 5}), 0.1);
    touching_fini(&a);
    touching_fini(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_spheres_overlap_as_a_lens),
        cmocka_unit_test(boxes_overlap_as_a_box_also_where_no_corner_lies_inside),
        cmocka_unit_test(the_volume_of_any_overlap_is_that_of_random_places),
        cmocka_unit_test(a_ball_deep_in_a_large_one_is_measured_in_larger_cubes),
        cmocka_unit_test(cartilage_and_bone_are_one_solid),
        cmocka_unit_test(a_sheet_has_an_inside_behind_it_and_none_past_its_border),
        cmocka_unit_test(the_gap_is_where_two_surfaces_are_nearest),
    };
    return cmocka_run_group_tests_name("check_touch", tests, NULL, NULL);
}
