#include "generate/tube.h"
#include "quality/quality.h"
#include "random.h"
#include "test.h"
#include "unit/washer.h"

// Samples stand 0.25 mm apart. A volume of width w has at most 0.25 / w too much or too little of
// it, far less where its sides do not follow the lattice.
#define SPACING 0.25

// ---- zones --------------------------------------------------------------------------------------

// The arc's ends are found to half a degree each, and a third of these arcs is 65 degrees or more.
static void a_washers_zones_have_their_volumes(void **state) {
    (void)state;
    struct random r = {1};
    for (int round = 0; round < 6; round++) {
        struct washer w = {random_between(&r, 6, 10), random_between(&r, 14, 20),
                           random_between(&r, 3, 8), random_between(&r, 1.7, 2.7)};
        struct washer_scene s;
        washer_scene_begin(&s, &w, random_pose(&r, 40), (struct quality_setting){0});
        struct zone_volumes shares = {0};
        zones_add_mesh(s.plan, &s.tissue, 1, &shares);
        struct quality_report report = quality_of(&s);
        for (int i = 0; i < ZONE_ALONG_COUNT; i++)
            for (int k = 0; k < ZONE_ACROSS_COUNT; k++) {
                double true_mm3 = washer_sector(washer_third(&w, k), washer_third(&w, k + 1),
                                                w.height, 2 * w.half / 3);
                assert_near(shares.mm3[i][k] / true_mm3, 1, 0.01);
                assert_near(report.whole.mm3[i][k] / true_mm3, 1, 0.01 + SPACING / w.height);
            }
        assert_near(zones_sum(&report.whole) / mesh_volume(&s.tissue), 1, SPACING / w.height);
        washer_scene_end(&s);
    }
}

static void a_points_zone_follows_from_its_place_in_plan(void **state) {
    (void)state;
    struct random r = {2};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    const double near_border = 0.02; // of the arc and of the width
    for (int round = 0; round < 3000; round++) {
        double along = random_between(&r, -0.1, 1.1), across = random_between(&r, -0.5, 1.5);
        if (fabs(along - 1 / 3.0) < near_border || fabs(along - 2 / 3.0) < near_border ||
            fabs(across - 1 / 3.0) < near_border || fabs(across - 2 / 3.0) < near_border)
            continue;
        double angle = washer_usual.half * (1 - 2 * along);
        double radius = washer_usual.inner + across * (washer_usual.outer - washer_usual.inner);
        vec3 p = washer_point(angle, radius, random_between(&r, -9, 9));
        enum zone_along got_along;
        enum zone_across got_across;
        quality_zone(s.plan, pose_apply(s.T_mesh_washer, p), &got_along, &got_across);
        assert_int_equal(got_along, along < 1 / 3.0 ? 0 : along < 2 / 3.0 ? 1 : 2);
        assert_int_equal(got_across, across < 1 / 3.0 ? 0 : across < 2 / 3.0 ? 1 : 2);
    }
    washer_scene_end(&s);
}

// A left knee's medial meniscus is a right knee's, mirrored: the anterior horn is the one in front
// whichever way the arc runs.
static void the_anterior_horn_is_in_front_on_either_side(void **state) {
    (void)state;
    for (int mirrored = 0; mirrored < 2; mirrored++)
        for (int lateral = 0; lateral < 2; lateral++) {
            struct mesh mesh;
            assert_true(tube_meniscus(lateral, 2400, 1.2, &mesh));
            for (uint32_t v = 0; mirrored && v < mesh.vertex_count; v++)
                mesh.positions[3 * (size_t)v] *= -1;
            struct quality_setting setting = {
                .tissue = &mesh, .up = {0, 0, 1}, .anterior = {0, 1, 0}};
            struct quality_plan *plan = quality_plan_create(&setting);
            struct box box = mesh_bounds(&mesh);
            for (uint32_t v = 0; v < mesh.vertex_count; v++) {
                vec3 p = mesh_vertex(&mesh, v);
                enum zone_along along;
                enum zone_across across;
                quality_zone(plan, p, &along, &across);
                double forward = (p.y - box.min.y) / (box.max.y - box.min.y);
                if (forward > 0.9)
                    assert_int_equal(along, ZONE_ANTERIOR_HORN);
                if (forward < 0.1)
                    assert_int_equal(along, ZONE_POSTERIOR_HORN);
                if (forward > 0.45 && forward < 0.55)
                    assert_int_equal(along, ZONE_BODY);
            }
            quality_plan_destroy(&plan);
            mesh_fini(&mesh);
        }
}

// ---- shares of triangles ------------------------------------------------------------------------

static void shares_add_up_to_the_volume(void **state) {
    (void)state;
    for (int lateral = 0; lateral < 2; lateral++) {
        struct mesh mesh;
        assert_true(tube_meniscus(lateral, 2400, 0.9, &mesh));
        struct quality_setting setting = {.tissue = &mesh, .up = {0, 0, 1}, .anterior = {0, 1, 0}};
        struct quality_plan *plan = quality_plan_create(&setting);
        struct quality *quality = quality_create(plan);
        struct zone_volumes shares = {0};
        zones_add_mesh(plan, &mesh, 1, &shares);
        assert_near(zones_sum(&shares) / mesh_volume(&mesh), 1, 1e-9);
        struct quality_report report;
        quality_report(quality, &report);
        assert_near(zones_sum(&report.whole) / mesh_volume(&mesh), 1, 0.002);
        for (int i = 0; i < ZONE_ALONG_COUNT; i++)
            for (int k = 0; k < ZONE_ACROSS_COUNT; k++)
                assert_near(shares.mm3[i][k] / report.whole.mm3[i][k], 1, 0.02); // some are thin
        quality_destroy(&quality);
        quality_plan_destroy(&plan);
        mesh_fini(&mesh);
    }
}

static void add_quarters(const struct quality_plan *plan, const vec3 c[3], int times_over,
                         struct zone_volumes *volumes) {
    if (times_over == 0) {
        quality_add_triangle(plan, c, 1, volumes);
        return;
    }
    vec3 m[3];
    for (int i = 0; i < 3; i++)
        m[i] = vec3_lerp(c[i], c[(i + 1) % 3], 0.5);
    for (int i = 0; i < 3; i++)
        add_quarters(plan, (vec3[]){c[i], m[i], m[(i + 2) % 3]}, times_over - 1, volumes);
    add_quarters(plan, m, times_over - 1, volumes);
}

static void a_large_triangle_has_the_shares_of_its_parts(void **state) {
    (void)state;
    struct random r = {17};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    vec3 corners[3] = {{-16, -2, 3}, {0, -18, 4}, {16, -2, 5}};
    for (int i = 0; i < 3; i++)
        corners[i] = pose_apply(s.T_mesh_washer, corners[i]);
    struct zone_volumes whole = {0}, parts = {0};
    quality_add_triangle(s.plan, corners, 1, &whole);
    add_quarters(s.plan, corners, 7, &parts);
    assert_near(zones_sum(&whole), 32 * 16 / 2 * 4,
                1e-3); // the plane is that of the mesh in floats
    for (int i = 0; i < ZONE_ALONG_COUNT; i++)
        for (int k = 0; k < ZONE_ACROSS_COUNT; k++)
            assert_near(whole.mm3[i][k], parts.mm3[i][k], 0.5);
    washer_scene_end(&s);
}

// As the triangles of a surface that gives way are: out with their old corners, in with the new.
static void taking_a_triangle_out_gives_back_what_it_gave(void **state) {
    (void)state;
    struct random r = {3};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    struct mesh moved;
    mesh_copy(&moved, &s.tissue);
    for (uint32_t v = 0; v < moved.vertex_count; v++)
        mesh_set_vertex(&moved, v, vec3_add(mesh_vertex(&moved, v), random_in_box(&r, 1)));
    struct zone_volumes changed = {0}, anew = {0};
    zones_add_mesh(s.plan, &s.tissue, 1, &changed);
    zones_add_mesh(s.plan, &s.tissue, -1, &changed);
    zones_add_mesh(s.plan, &moved, 1, &changed);
    zones_add_mesh(s.plan, &moved, 1, &anew);
    for (int i = 0; i < ZONE_ALONG_COUNT; i++)
        for (int k = 0; k < ZONE_ACROSS_COUNT; k++)
            assert_near(changed.mm3[i][k], anew.mm3[i][k], 1e-9);
    assert_near(zones_sum(&anew) / mesh_volume(&moved), 1, 1e-9);
    mesh_fini(&moved);
    washer_scene_end(&s);
}

// ---- columns ----

// Vertices and edges that the lattice's columns meet exactly, and faces along them.
static void no_column_slips_between_triangles(void **state) {
    (void)state;
    struct mesh mesh;
    assert_true(tube_meniscus(false, 2400, 0.9, &mesh));
    for (size_t i = 0; i < 3 * (size_t)mesh.vertex_count; i++)
        if (i % 3 != 2)
            mesh.positions[i] = roundf(8 * mesh.positions[i]) / 8;
    struct quality_setting setting = {.tissue = &mesh, .up = {0, 0, 1}, .anterior = {0, 1, 0}};
    struct quality_plan *plan = quality_plan_create(&setting);
    struct quality *quality = quality_create(plan);
    struct quality_report report;
    quality_report(quality, &report);
    assert_near(zones_sum(&report.whole) / mesh_volume(&mesh), 1, 0.005);
    quality_destroy(&quality);
    quality_plan_destroy(&plan);
    mesh_fini(&mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_washers_zones_have_their_volumes),
        cmocka_unit_test(a_points_zone_follows_from_its_place_in_plan),
        cmocka_unit_test(the_anterior_horn_is_in_front_on_either_side),
        cmocka_unit_test(shares_add_up_to_the_volume),
        cmocka_unit_test(a_large_triangle_has_the_shares_of_its_parts),
        cmocka_unit_test(taking_a_triangle_out_gives_back_what_it_gave),
        cmocka_unit_test(no_column_slips_between_triangles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
