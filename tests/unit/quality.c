#include "quality/quality.h"

#include "random.h"
#include "test.h"
#include "unit/washer.h"

// Samples stand 0.25 mm apart. A volume of width w has at most 0.25 / w too much or too little of
// it, far less where its sides do not follow the lattice.
#define SPACING 0.25

// ---- what was taken -----------------------------------------------------------------------------

static void nothing_is_taken_at_first(void **state) {
    (void)state;
    struct random r = {4};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    struct quality_report report = quality_of(&s);
    assert_true(report.removed_mm3 == 0 && report.planned_mm3 == 0 && report.over_mm3 == 0);
    assert_true(report.under_mm3 == 0 && report.damage_mm3 == 0);
    assert_true(zones_sum(&report.budget) == 0); // no S'_max: nothing may go
    assert_near(report.rim_mm, washer_usual.outer - washer_usual.inner, 2 * SPACING);
    assert_true(report.step_mm == 0);
    washer_scene_end(&s);
}

// Boxes in the body's flank, where x follows the arc and -y is outwards.
static void over_and_under_are_what_the_plan_and_the_cut_do_not_share(void **state) {
    (void)state;
    struct random r = {5};
    pose T = random_pose(&r, 40);
    struct convex plan[2] = {convex_box(T, (vec3){-3, -14, -1.5}, (vec3){1, -9, 1.5}),
                             convex_box(T, (vec3){-1, -14, -1.5}, (vec3){3, -9, 1.5})};
    struct convex damage = convex_box(T, (vec3){-2, -12, -1}, (vec3){2, -10, 1});
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, T,
                       (struct quality_setting){
                           .plan = plan, .plan_count = 2, .damage = &damage, .damage_count = 1});
    // A side of the box that follows the lattice is off by half a spacing at most.
    const double off = SPACING / 2 * 2 * (1 / 6.0 + 1 / 5.0 + 1 / 3.0);
    struct quality_report report = quality_of(&s);
    assert_near(report.planned_mm3 / 90, 1, off);
    assert_true(report.under_mm3 == report.planned_mm3);
    assert_near(report.damage_mm3 / 16, 1, SPACING * (1 / 4.0 + 1 / 2.0 + 1 / 2.0));
    struct convex cut = convex_box(T, (vec3){0, -14, -1.5}, (vec3){6, -9, 1.5});
    quality_take_parts(s.quality, &cut, 1);
    report = quality_of(&s);
    assert_near(report.removed_mm3 / 90, 1, off);
    assert_near(report.over_mm3 / 45, 1, off);
    assert_near(report.under_mm3 / 45, 1, off);
    assert_near(report.damage_mm3 / 8, 1, SPACING * 1.5);
    assert_true(report.removed_mm3 - report.over_mm3 + report.under_mm3 == report.planned_mm3);
    assert_near(zones_sum(&report.removed), report.removed_mm3, 1e-9);
    washer_scene_end(&s);
}

static void tissue_goes_once(void **state) {
    (void)state;
    struct random r = {6};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    struct convex cuts[2] = {convex_box(s.T_mesh_washer, (vec3){-4, -20, -9}, (vec3){2, 0, 9}),
                             convex_box(s.T_mesh_washer, (vec3){-2, -20, -9}, (vec3){4, 0, 9})};
    quality_take_parts(s.quality, cuts, 2);
    struct quality_report once = quality_of(&s);
    quality_take_parts(s.quality, cuts, 2);
    struct quality_report twice = quality_of(&s);
    assert_memory_equal(&once, &twice, sizeof once);
    struct convex both = convex_box(s.T_mesh_washer, (vec3){-4, -20, -9}, (vec3){4, 0, 9});
    struct quality *other = quality_create(s.plan);
    quality_take_parts(other, &both, 1);
    quality_report(other, &twice);
    assert_memory_equal(&once, &twice, sizeof once);
    quality_destroy(&other);
    washer_scene_end(&s);
}

// Against the convex itself, point by point, on a lattice of the test's own.
static void any_convex_takes_its_share_of_the_tissue(void **state) {
    (void)state;
    struct random r = {7};
    for (int round = 0; round < 5; round++) {
        struct washer_scene s;
        washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
        vec3 middle = pose_apply(s.T_mesh_washer, (vec3){random_between(&r, -9, 9), -11, 0});
        struct plane planes[12];
        for (int i = 0; i < 12; i++) {
            vec3 n = random_direction(&r);
            planes[i] = (struct plane){n, vec3_dot(n, middle) + random_between(&r, 2, 4)};
        }
        struct convex cut;
        if (convex_create(planes, 12, &cut, NULL) != RESULT_OK || cut.volume > 2000) {
            washer_scene_end(&s);
            continue;
        }
        const double step = 0.3;
        double true_mm3 = 0;
        for (double x = cut.box.min.x; x < cut.box.max.x; x += step)
            for (double y = cut.box.min.y; y < cut.box.max.y; y += step)
                for (double z = cut.box.min.z; z < cut.box.max.z; z += step) {
                    vec3 p = {x, y, z}, q = pose_apply_inverse(s.T_mesh_washer, p);
                    double radius = hypot(q.x, q.y);
                    bool in_tissue = radius > washer_usual.inner && radius < washer_usual.outer &&
                                     fabs(q.z) < washer_usual.height / 2 &&
                                     fabs(atan2(q.x, -q.y)) < washer_usual.half;
                    true_mm3 += in_tissue && convex_contains(&cut, p) ? step * step * step : 0;
                }
        quality_take_parts(s.quality, &cut, 1);
        assert_true(true_mm3 > 20);
        assert_near(quality_of(&s).removed_mm3 / true_mm3, 1, 0.08);
        washer_scene_end(&s);
    }
}

// ---- budget -------------------------------------------------------------------------------------

// S'_max keeps the outer third alone.
static void the_budget_is_what_lies_outside_the_least(void **state) {
    (void)state;
    struct random r = {8};
    pose T = random_pose(&r, 40);
    struct washer rim = washer_usual;
    rim.inner = washer_third(&washer_usual, 2);
    struct mesh least;
    washer_mesh(&rim, T, &least);
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, T, (struct quality_setting){.least = &least});
    struct quality_report report = quality_of(&s);
    for (int i = 0; i < ZONE_ALONG_COUNT; i++) {
        for (int k = 0; k < 2; k++)
            assert_near(report.budget.mm3[i][k] / report.whole.mm3[i][k], 1, 0.01);
        assert_near(report.budget.mm3[i][2] / report.whole.mm3[i][2], 0, 0.01);
    }
    washer_scene_end(&s);
    mesh_fini(&least);
}

// ---- pieces -------------------------------------------------------------------------------------

static void the_whole_as_a_piece_takes_all(void **state) {
    (void)state;
    struct random r = {9};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    quality_take_piece(s.quality, &s.tissue);
    struct quality_report report = quality_of(&s);
    assert_memory_equal(&report.removed, &report.whole, sizeof report.whole);
    assert_true(report.rim_mm == 0);
    washer_scene_end(&s);
}

static void a_piece_takes_what_a_blade_of_its_shape_takes(void **state) {
    (void)state;
    struct random r = {10};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    for (int round = 0; round < 30; round++) {
        vec3 low = {random_between(&r, -12, 4), random_between(&r, -20, -12),
                    random_between(&r, -3, 0)};
        vec3 high = {low.x + random_between(&r, 2, 8), low.y + random_between(&r, 2, 8), low.z + 2};
        pose tilt = pose_compose(s.T_mesh_washer, random_pose(&r, 2));
        struct convex box = convex_box(tilt, low, high);
        struct mesh mesh;
        convex_mesh(&box, &mesh);
        struct quality *cut = quality_create(s.plan), *torn = quality_create(s.plan);
        struct quality_report by_parts, by_piece;
        quality_take_parts(cut, &box, 1);
        quality_take_piece(torn, &mesh);
        quality_report(cut, &by_parts);
        quality_report(torn, &by_piece);
        assert_near(by_piece.removed_mm3, by_parts.removed_mm3, 0.05); // three samples on its sides
        quality_take_piece(cut, &mesh);
        quality_report(cut, &by_piece);
        assert_near(by_piece.removed_mm3, by_parts.removed_mm3, 0.05);
        quality_destroy(&cut);
        quality_destroy(&torn);
        mesh_fini(&mesh);
    }
    washer_scene_end(&s);
}

static void two_boxes_mesh(const struct convex boxes[2], struct mesh *out_mesh) {
    mesh_init(out_mesh, 16, 24);
    for (uint32_t k = 0; k < 2; k++) {
        struct mesh mesh;
        convex_mesh(&boxes[k], &mesh);
        for (uint32_t i = 0; i < 8; i++)
            mesh_set_vertex(out_mesh, 8 * k + i, mesh_vertex(&mesh, i));
        for (uint32_t i = 0; i < 36; i++)
            out_mesh->triangles[36 * k + i] = 8 * k + mesh.triangles[i];
        mesh_fini(&mesh);
    }
}

// Two bodies that share some of their space, as scans have them; and one that is inside out.
static void a_piece_that_overlaps_itself_takes_its_union(void **state) {
    (void)state;
    struct random r = {16};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    struct convex boxes[2] = {convex_box(s.T_mesh_washer, (vec3){-4, -15, -1}, (vec3){2, -10, 1}),
                              convex_box(s.T_mesh_washer, (vec3){-2, -14, -3}, (vec3){4, -9, 3})};
    struct mesh inside_out, both;
    convex_mesh(&boxes[0], &inside_out);
    for (uint32_t i = 0; i < 36; i += 3) {
        uint32_t corner = inside_out.triangles[i];
        inside_out.triangles[i] = inside_out.triangles[i + 1];
        inside_out.triangles[i + 1] = corner;
    }
    two_boxes_mesh(boxes, &both);
    quality_take_piece(s.quality, &inside_out);
    assert_true(quality_of(&s).removed_mm3 == 0);
    quality_take_piece(s.quality, &both);
    double by_piece = quality_of(&s).removed_mm3;
    struct quality *cut = quality_create(s.plan);
    struct quality_report by_parts;
    quality_take_parts(cut, boxes, 2);
    quality_report(cut, &by_parts);
    assert_near(by_piece, by_parts.removed_mm3, 0.1);
    quality_destroy(&cut);
    mesh_fini(&inside_out);
    mesh_fini(&both);
    washer_scene_end(&s);
}

// Two leaves with a cleft between them, which is no tissue.
static void a_cleft_in_the_tissue_is_not_counted(void **state) {
    (void)state;
    struct convex leaves[2] = {convex_box(pose_identity(), (vec3){-10, -8, -2}, (vec3){10, 8, -1}),
                               convex_box(pose_identity(), (vec3){-10, -8, 1}, (vec3){10, 8, 2})};
    struct mesh mesh;
    two_boxes_mesh(leaves, &mesh);
    struct quality_setting setting = {
        .tissue = &mesh, .up = {0, 0, 1}, .anterior = {0, 1, 0}, .least = &mesh};
    struct convex all = convex_box(pose_identity(), (vec3){-11, -9, -3}, (vec3){11, 9, 3});
    setting.plan = setting.damage = &all;
    setting.plan_count = setting.damage_count = 1;
    struct quality_plan *plan = quality_plan_create(&setting);
    struct quality *quality = quality_create(plan);
    struct quality_report report;
    quality_report(quality, &report);
    assert_near(zones_sum(&report.whole), 640, 1e-9);
    assert_near(report.planned_mm3, 640, 1e-9);
    assert_near(report.damage_mm3, 640, 1e-9);
    assert_true(zones_sum(&report.budget) == 0);
    quality_take_parts(quality, &all, 1);
    quality_report(quality, &report);
    assert_near(report.removed_mm3, 640, 1e-9);
    assert_true(report.under_mm3 == 0 && report.over_mm3 == 0 && report.damage_mm3 == 0);
    quality_destroy(&quality);
    quality_plan_destroy(&plan);
    mesh_fini(&mesh);
}

// A discoid meniscus is no C: its zones mean little, but all is counted.
static void a_disc_is_counted_too(void **state) {
    (void)state;
    struct convex box = convex_box(pose_identity(), (vec3){-10, -8, -2}, (vec3){10, 8, 2});
    struct mesh disc;
    convex_mesh(&box, &disc);
    struct quality_setting setting = {.tissue = &disc, .up = {0, 0, 1}, .anterior = {0, 1, 0}};
    struct quality_plan *plan = quality_plan_create(&setting);
    struct quality *quality = quality_create(plan);
    struct zone_volumes shares = {0};
    zones_add_mesh(plan, &disc, 1, &shares);
    assert_near(zones_sum(&shares), 1280, 1e-9);
    struct convex far_off = convex_box(pose_identity(), (vec3){30, -8, -2}, (vec3){40, 8, 2});
    quality_take_parts(quality, &far_off, 1);
    quality_take_parts(quality, &box, 1);
    struct quality_report report;
    quality_report(quality, &report);
    assert_near(report.removed_mm3, 1280, 1e-9);
    quality_destroy(&quality);
    quality_plan_destroy(&plan);
    mesh_fini(&disc);
}

// ---- the rim ------------------------------------------------------------------------------------

// Cut away within a radius, from one angle to another: convex wedges from the centre.
static void take_wedges(struct washer_scene *s, double radius, double from, double to) {
    enum { WEDGES = 40 };
    for (int i = 0; i < WEDGES; i++) {
        double a = from + (to - from) * i / WEDGES, b = from + (to - from) * (i + 1) / WEDGES;
        vec3 across = washer_point((a + b) / 2, 1, 0);
        vec3 before = {-cos(a), -sin(a), 0}, after = {cos(b), sin(b), 0};
        struct plane planes[5] = {{before, 0},
                                  {after, 0},
                                  {across, radius * cos((b - a) / 2)},
                                  {{0, 0, 1}, 9},
                                  {{0, 0, -1}, 9}};
        for (int k = 0; k < 5; k++) {
            planes[k].normal = quat_rotate(s->T_mesh_washer.rotation, planes[k].normal);
            planes[k].offset += vec3_dot(planes[k].normal, s->T_mesh_washer.translation);
        }
        struct convex wedge;
        struct error err;
        if (convex_create(planes, 5, &wedge, &err) != RESULT_OK)
            fail_msg("%s", err.text);
        quality_take_parts(s->quality, &wedge, 1);
    }
}

// A width is the length of a ray within square columns: each end off by half their diagonal at
// most.
static const double width_error = 2 * 0.1768 + 0.05;

static void the_rim_is_what_a_cut_leaves_of_the_width(void **state) {
    (void)state;
    struct random r = {11};
    for (int round = 0; round < 8; round++) {
        struct washer_scene s;
        washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
        double radius = random_between(&r, 9, 16), from = random_between(&r, -1.5, 0.5);
        take_wedges(&s, radius, from, from + 1);
        struct quality_report report = quality_of(&s);
        assert_near(report.removed_mm3 /
                        washer_sector(washer_usual.inner, radius, washer_usual.height, 1),
                    1, SPACING * (1 / (radius - washer_usual.inner) + 1 / washer_usual.height));
        assert_near(report.rim_mm, washer_usual.outer - radius, width_error);
        assert_near(report.step_mm, radius - washer_usual.inner,
                    2 * width_error); // its ends are radial
        washer_scene_end(&s);
    }
}

static void an_even_cut_makes_no_step(void **state) {
    (void)state;
    struct random r = {12};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    take_wedges(&s, 12.5, -washer_usual.half, washer_usual.half);
    struct quality_report report = quality_of(&s);
    assert_near(report.rim_mm, washer_usual.outer - 12.5, width_error);
    assert_true(report.step_mm < 2 * width_error);
    washer_scene_end(&s);
}

// Taking a tooth off an inner margin makes its contour more even, not less.
static void the_step_is_beside_that_of_the_uncut_contour(void **state) {
    (void)state;
    struct random r = {13};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    take_wedges(&s, 13, -0.4, 0.4);
    double deep = quality_of(&s).step_mm;
    take_wedges(&s, 13, -1.5, 1.5);
    take_wedges(&s, 11, -2.2, 2.2);
    double shallow = quality_of(&s).step_mm;
    assert_near(deep, 5, 2 * width_error);
    assert_near(shallow, 2, 2 * width_error);
    washer_scene_end(&s);
}

// A radial tear through to the rim, and a cleft along the rim that parts a handle from it.
static void what_is_cut_off_from_the_rim_is_no_rim(void **state) {
    (void)state;
    struct random r = {14};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    struct convex cleft = convex_box(s.T_mesh_washer, (vec3){-3, -14, -9}, (vec3){3, -13, 9});
    quality_take_parts(s.quality, &cleft, 1);
    assert_near(quality_of(&s).rim_mm, washer_usual.outer - hypot(3, 14), width_error);
    struct convex tear = convex_box(s.T_mesh_washer, (vec3){-0.6, -20, -9}, (vec3){0.6, 0, 9});
    quality_take_parts(s.quality, &tear, 1);
    assert_true(quality_of(&s).rim_mm == 0);
    washer_scene_end(&s);
}

// The upper three quarters of the height may go before a column counts as gone.
static void a_leaf_that_stays_is_still_rim(void **state) {
    (void)state;
    struct random r = {15};
    struct washer_scene s;
    washer_scene_begin(&s, &washer_usual, random_pose(&r, 40), (struct quality_setting){0});
    double whole = quality_of(&s).rim_mm;
    struct convex upper = convex_box(s.T_mesh_washer, (vec3){-5, -20, -0.5}, (vec3){5, 0, 9});
    quality_take_parts(s.quality, &upper, 1);
    assert_true(quality_of(&s).rim_mm == whole);
    struct convex more = convex_box(s.T_mesh_washer, (vec3){-5, -20, -1.5}, (vec3){5, 0, 9});
    quality_take_parts(s.quality, &more, 1);
    assert_true(quality_of(&s).rim_mm == 0);
    washer_scene_end(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_taken_at_first),
        cmocka_unit_test(over_and_under_are_what_the_plan_and_the_cut_do_not_share),
        cmocka_unit_test(tissue_goes_once),
        cmocka_unit_test(any_convex_takes_its_share_of_the_tissue),
        cmocka_unit_test(the_budget_is_what_lies_outside_the_least),
        cmocka_unit_test(the_whole_as_a_piece_takes_all),
        cmocka_unit_test(a_piece_takes_what_a_blade_of_its_shape_takes),
        cmocka_unit_test(a_piece_that_overlaps_itself_takes_its_union),
        cmocka_unit_test(a_cleft_in_the_tissue_is_not_counted),
        cmocka_unit_test(a_disc_is_counted_too),
        cmocka_unit_test(the_rim_is_what_a_cut_leaves_of_the_width),
        cmocka_unit_test(an_even_cut_makes_no_step),
        cmocka_unit_test(the_step_is_beside_that_of_the_uncut_contour),
        cmocka_unit_test(what_is_cut_off_from_the_rim_is_no_rim),
        cmocka_unit_test(a_leaf_that_stays_is_still_rim),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
