// The joint in a motion: in contact, and on the rest path of its case.
#include "generated.h"
#include "mesh/solid.h"
#include "motion/joint.h"
#include "random.h"
#include "unit/motion_scripts.h"
#include "winding.h"


static struct knee_case *knee; // healthy, right

static int make_knee(void **state) {
    (void)state;
    knee = plain_knee(SIDE_RIGHT, 1.7, 0);
    return 0;
}

static int destroy_knee(void **state) {
    (void)state;
    case_destroy(&knee);
    return 0;
}

// The least signed distance of the femur's vertices on one side (1 lateral) from the tibia.
static double gap_on(const struct solid *tibia, const struct joint_angles *joint, double side) {
    const struct mesh *femur = &case_group(knee, "femur")->mesh;
    pose T = joint_to_pose(&knee->joint, joint);
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = mesh_vertex(femur, v);
        if (side * p.x > 5)
            least = fmin(least, solid_distance(tibia, pose_apply_inverse(T, p), &hint));
    }
    return least;
}

static struct joint_angles hold(const struct solid *femur, const struct solid *tibia,
                                double flexion, double valgus, double drawer) {
    struct joint_hold held = {flexion, valgus, 0, drawer};
    return motion_joint(knee, femur, tibia, &held);
}

static void valgus_opens_the_medial_side_about_the_lateral_contact(void **state) {
    (void)state;
    struct solid femur, tibia;
    assert_int_equal(solid_init(&femur, &case_group(knee, "femur")->mesh, NULL), RESULT_OK);
    assert_int_equal(solid_init(&tibia, &case_group(knee, "tibia")->mesh, NULL), RESULT_OK);
    for (int flexion = 0; flexion <= 90; flexion += 30) {
        struct joint_angles rest = hold(&femur, &tibia, flexion, 0, 0);
        struct joint_angles valgus = hold(&femur, &tibia, flexion, 8, 0);
        struct joint_angles varus = hold(&femur, &tibia, flexion, -5, 0);
        assert_near(rest.shift_mm, 0, 0);
        assert_near(valgus.varus_deg, -8, 1e-9);
        assert_near(valgus.flexion_deg, flexion, 1e-9);
        assert_near(gap_on(&tibia, &valgus, 1), gap_on(&tibia, &rest, 1), 0.02);
        assert_true(gap_on(&tibia, &valgus, -1) > 4);
        assert_near(gap_on(&tibia, &varus, -1), gap_on(&tibia, &rest, -1), 0.02);
        assert_true(gap_on(&tibia, &varus, 1) > 2);
    }
    solid_fini(&femur);
    solid_fini(&tibia);
}

static void drawer_glides_the_tibia_and_keeps_the_bones_in_contact(void **state) {
    (void)state;
    struct solid femur, tibia;
    assert_int_equal(solid_init(&femur, &case_group(knee, "femur")->mesh, NULL), RESULT_OK);
    assert_int_equal(solid_init(&tibia, &case_group(knee, "tibia")->mesh, NULL), RESULT_OK);
    for (int flexion = 0; flexion <= 90; flexion += 30) {
        struct joint_angles rest = hold(&femur, &tibia, flexion, 0, 0);
        double gap = fmin(gap_on(&tibia, &rest, 1), gap_on(&tibia, &rest, -1));
        for (double drawer = -5; drawer <= 10; drawer += 5) {
            for (int valgus = 0; valgus <= 8; valgus += 8) {
                struct joint_angles drawn = hold(&femur, &tibia, flexion, valgus, drawer);
                assert_near(drawn.drawer_mm, drawer, 1e-3); // the valgus pivot may bring a little
                assert_near(drawn.varus_deg, -valgus, 1e-9);
                assert_near(drawn.flexion_deg, flexion, 1e-9);
                assert_near(drawn.internal_deg, 0, 1e-9);
                assert_near(fmin(gap_on(&tibia, &drawn, 1), gap_on(&tibia, &drawn, -1)), gap, 0.02);
            }
        }
        struct joint_hold turned = {.flexion_deg = flexion, .internal_deg = 10};
        struct joint_angles angles = motion_joint(knee, &femur, &tibia, &turned);
        assert_near(angles.internal_deg, 10, 1e-9);
        assert_near(fmin(gap_on(&tibia, &angles, 1), gap_on(&tibia, &angles, -1)), gap, 0.02);
    }
    solid_fini(&femur);
    solid_fini(&tibia);
}

// Off the joint's axes by up to 2 degrees and 1 mm, as of a knee whose tibia glides.
static void give_rest_path(struct knee_case *on) {
    for (int i = 0; i <= 4; i++) {
        struct joint_angles key = {.flexion_deg = 30 * i,
                                   .varus_deg = 0.5 * i,
                                   .internal_deg = -0.4 * i,
                                   .drawer_mm = 0.25 * i,
                                   .distraction_mm = 0.1 * i};
        on->rest[on->rest_count++] = joint_to_pose(&on->joint, &key);
    }
}

static void the_joint_follows_the_rest_path_of_the_case(void **state) {
    (void)state;
    struct solid femur, tibia;
    struct motion motion;
    give_rest_path(knee);
    plan_text(knee, "[steps]\nflex = 90\n", &motion);
    for (size_t i = 0; i < motion.row_count; i++) {
        const struct joint_angles *j = &motion.rows[i].joint;
        assert_near(j->varus_deg, 0.5 / 30 * j->flexion_deg, 1e-6);
        assert_near(j->internal_deg, -0.4 / 30 * j->flexion_deg, 1e-6);
        assert_near(j->drawer_mm, 0.25 / 30 * j->flexion_deg, 1e-6);
        assert_near(j->distraction_mm, 0.1 / 30 * j->flexion_deg, 1e-6);
    }
    motion_fini(&motion);
    assert_int_equal(solid_init(&femur, &case_group(knee, "femur")->mesh, NULL), RESULT_OK);
    assert_int_equal(solid_init(&tibia, &case_group(knee, "tibia")->mesh, NULL), RESULT_OK);
    struct joint_angles rest = hold(&femur, &tibia, 60, 0, 0);
    struct joint_angles valgus = hold(&femur, &tibia, 60, 8, 0);
    struct joint_angles drawn = hold(&femur, &tibia, 60, 0, 5);
    assert_near(valgus.varus_deg, rest.varus_deg - 8, 1e-9);
    assert_near(gap_on(&tibia, &valgus, 1), gap_on(&tibia, &rest, 1), 0.02);
    assert_near(drawn.drawer_mm, rest.drawer_mm + 5, 1e-3);
    assert_near(drawn.varus_deg, rest.varus_deg, 1e-9);
    assert_near(drawn.internal_deg, rest.internal_deg, 1e-9);
    solid_fini(&femur);
    solid_fini(&tibia);
    knee->rest_count = 0;
}

static void assert_signs_agree(const struct mesh *mesh, double spread) {
    struct solid solid;
    assert_int_equal(solid_init(&solid, mesh, NULL), RESULT_OK);
    struct random random = {7};
    uint32_t hint = MESH_NONE;
    for (int i = 0; i < 1000; i++) {
        uint32_t v = (uint32_t)(random_bits(&random) % mesh->vertex_count);
        vec3 p = vec3_add(mesh_vertex(mesh, v), random_in_box(&random, spread));
        assert_true((solid_distance(&solid, p, &hint) < 0) == is_inside(mesh, p));
    }
    solid_fini(&solid);
}

static void signed_distances_agree_with_the_solid_angle(void **state) {
    (void)state;
    assert_signs_agree(&case_group(knee, "meniscus_medial")->mesh, 2);
    // A splinter: near its points and edges a face's normal alone gives the wrong side.
    float positions[] = {0, 0, 0, 1, 0.2f, 0, 0.3f, 1, 0, 4, 3, 9};
    uint32_t triangles[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    struct mesh splinter = {4, 4, positions, triangles};
    assert_signs_agree(&splinter, 3);
}
int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(valgus_opens_the_medial_side_about_the_lateral_contact),
        cmocka_unit_test(drawer_glides_the_tibia_and_keeps_the_bones_in_contact),
        cmocka_unit_test(the_joint_follows_the_rest_path_of_the_case),
        cmocka_unit_test(signed_distances_agree_with_the_solid_angle),
    };
    return cmocka_run_group_tests(tests, make_knee, destroy_knee);
}
