// Cuts that are exactly degenerate, and blades that are none.

#include "cutting/bites.h"
#include "cutting/inside.h"
#include "cutting/specimens.h"
#include "cutting/trial.h"
#include "cutting/voxels.h"
#include "scene/shapes.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

// ---- exactly degenerate -------------------------------------------------------------------------

static void boxes_on_a_lattice_take_exactly_their_voxels(void **state) {
    (void)state;
    int cuts = 0, pieces = 0;
    for (uint64_t seed = 1; seed <= 80; seed++) {
        struct voxel_run run = voxel_sequence(seed, 25);
        if (run.fault)
            fail_msg("seed %d, after %d cuts: %s", (int)seed, run.cuts, run.fault);
        assert_near(run.volume_error, 0, 0.01);
        assert_near(run.area_error, 0, 0.05);
        cuts += run.cuts;
        pieces += run.pieces;
    }
    assert_true(cuts > 600);
    assert_true(pieces > 10);
}

static void flush_bites_leave_no_membrane(void **state) {
    (void)state;
    struct mesh cube;
    struct trial trial;
    shape_box(&cube, (vec3){4, 4, 4});
    trial_init(&trial, &cube);
    for (int i = 0; i < 8; i++) { // a groove along x, 2 mm wide, 1 mm deep
        struct convex box;
        convex_box((pose){quat_identity(), {i - 3.5, 0, 4}}, (vec3){0.5, 1, 1}, &box);
        trial_cut(&trial, &box, 1);
        assert_int_equal(CUT_CHANGED, trial.outcome);
        assert_null(trial.fault);
        assert_near(trial.change.removed_mm3, 2, 0.001);
        assert_int_equal(0, trial.change.piece_count);
    }
    struct locator *locator = locator_create(&trial.now);
    for (double x = -3.9; x < 4; x += 0.01)
        assert_false(locator_inside(locator, (vec3){x, 0.123, 3.5}));
    locator_destroy(&locator);
    trial_fini(&trial);
    mesh_fini(&cube);
}

static void a_blade_inside_makes_a_cavity_that_stays(void **state) {
    (void)state;
    struct mesh ball;
    struct trial trial;
    struct convex box;
    struct random r = {3};
    shape_sphere(&ball, 6, 12);
    trial_init(&trial, &ball);
    convex_box((pose){random_pose(&r, 0).rotation, {0.5, 1, 0}}, (vec3){1, 1.5, 0.5}, &box);
    trial_cut(&trial, &box, 1);
    assert_int_equal(CUT_CHANGED, trial.outcome);
    assert_null(trial.fault);
    assert_near(trial.change.removed_mm3, 6, 1e-3);
    assert_int_equal(0, trial.change.freed_count);
    assert_int_equal(0, trial.change.piece_count);
    convex_box((pose){quat_identity(), {3, 1, 0}}, (vec3){4, 0.2, 0.2}, &box);
    trial_cut(&trial, &box, 1); // a channel that opens it
    assert_int_equal(CUT_CHANGED, trial.outcome);
    assert_null(trial.fault);
    trial_fini(&trial);
    mesh_fini(&ball);
}

// ---- no change ----------------------------------------------------------------------------------

static void expect(struct trial *trial, const struct convex *parts, int count,
                   enum cut_outcome outcome) {
    trial_cut(trial, parts, count);
    assert_int_equal(outcome, trial->outcome);
    assert_null(trial->fault);
    if (outcome == CUT_REFUSED)
        assert_true(strlen(trial->err.text) > 0);
}

static void blades_that_take_nothing_or_all_change_nothing(void **state) {
    (void)state;
    for (int specimen = 0; specimen < SPECIMENS; specimen++) {
        struct mesh mesh;
        struct trial trial;
        struct convex parts[2];
        specimen_make((enum specimen)specimen, &mesh);
        struct box box = mesh_bounds(&mesh);
        vec3 middle = vec3_lerp(box.min, box.max, 0.5), half = vec3_sub(box.max, middle);
        trial_init(&trial, &mesh);
        convex_box((pose){quat_identity(), {200, 0, 0}}, (vec3){1, 1, 1}, &parts[0]);
        expect(&trial, parts, 1, CUT_NOTHING);
        expect(&trial, parts, 0, CUT_NOTHING);
        convex_box((pose){quat_identity(), middle}, vec3_scale(1.5, half), &parts[1]);
        expect(&trial, parts + 1, 1, CUT_REFUSED);
        expect(&trial, parts, 2, CUT_REFUSED);
        vec3 corner = mesh_vertex(&mesh, 0); // a corner of it less than 1e-4 mm³ deep
        convex_box((pose){quat_identity(), corner}, (vec3){0.015, 0.015, 0.015}, &parts[0]);
        expect(&trial, parts, 1, CUT_NOTHING);
        trial_fini(&trial);
        mesh_fini(&mesh);
    }
}

static void two_halves_that_take_all_are_refused_as_a_whole(void **state) {
    (void)state;
    struct mesh mesh;
    struct trial trial;
    struct convex parts[2];
    specimen_make(SPECIMEN_SPHERE, &mesh);
    trial_init(&trial, &mesh);
    convex_box((pose){quat_identity(), {-5, 0, 0}}, (vec3){5, 8, 8}, &parts[0]);
    convex_box((pose){quat_identity(), {5, 0, 0}}, (vec3){5, 8, 8}, &parts[1]);
    expect(&trial, parts, 2, CUT_REFUSED);
    expect(&trial, parts, 1, CUT_CHANGED);
    trial_fini(&trial);
    mesh_fini(&mesh);
}

static void half_spaces_that_are_no_blade_are_told(void **state) {
    (void)state;
    struct convex box, out;
    struct error err;
    convex_box(pose_identity(), (vec3){1, 1, 1}, &box);
    static const double odd[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 3; k++) {
            struct plane planes[6];
            memcpy(planes, box.planes, sizeof planes);
            planes[i].normal.y = odd[k];
            assert_int_equal(RESULT_INVALID, convex_create(planes, 6, &out, &err));
            memcpy(planes, box.planes, sizeof planes);
            planes[i].offset = odd[k];
            assert_int_equal(RESULT_INVALID, convex_create(planes, 6, &out, &err));
            assert_true(strlen(err.text) > 0);
        }
    struct plane inwards[6];
    for (int i = 0; i < 6; i++)
        inwards[i] = (struct plane){vec3_scale(-1, box.planes[i].normal), -box.planes[i].offset};
    assert_int_equal(RESULT_INVALID, convex_create(inwards, 6, &out, &err));
    assert_int_equal(RESULT_INVALID, convex_create(box.planes, 3, &out, &err));
}

// ---- meshes that are none -----------------------------------------------------------------------

static void expect_no_mesh(const struct mesh *mesh) {
    struct cut_mesh *cut;
    struct error err = {0};
    assert_int_equal(RESULT_INVALID, cut_mesh_create(mesh, &cut, &err));
    assert_true(strlen(err.text) > 0);
}

static void only_closed_manifold_oriented_meshes_that_face_outwards_can_be_cut(void **state) {
    (void)state;
    struct mesh ball, mesh;
    shape_sphere(&ball, 5, 4);
    mesh_copy(&mesh, &ball);
    mesh.triangle_count--; // open
    expect_no_mesh(&mesh);
    mesh_fini(&mesh);
    mesh_copy(&mesh, &ball);
    for (uint32_t t = 0; t < mesh.triangle_count; t++) { // inside out
        uint32_t v = mesh.triangles[3 * t];
        mesh.triangles[3 * t] = mesh.triangles[3 * t + 1];
        mesh.triangles[3 * t + 1] = v;
        if (t == 0) // one triangle first
            expect_no_mesh(&mesh);
    }
    expect_no_mesh(&mesh);
    mesh_fini(&mesh);
    mesh_copy(&mesh, &ball);
    mesh.positions[4] = NAN;
    expect_no_mesh(&mesh);
    mesh_fini(&mesh);
    shape_moebius(&mesh, 5, 1, 12);
    expect_no_mesh(&mesh);
    mesh_fini(&mesh);
    mesh_fini(&ball);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boxes_on_a_lattice_take_exactly_their_voxels),
        cmocka_unit_test(flush_bites_leave_no_membrane),
        cmocka_unit_test(a_blade_inside_makes_a_cavity_that_stays),
        cmocka_unit_test(blades_that_take_nothing_or_all_change_nothing),
        cmocka_unit_test(two_halves_that_take_all_are_refused_as_a_whole),
        cmocka_unit_test(half_spaces_that_are_no_blade_are_told),
        cmocka_unit_test(only_closed_manifold_oriented_meshes_that_face_outwards_can_be_cut),
    };
    return cmocka_run_group_tests_name("cut_odd", tests, NULL, NULL);
}
