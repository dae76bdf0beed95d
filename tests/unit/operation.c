// What an operation tells of a cut, where it can be told by hand: on a meniscus that is a box.
#include "step/operation.h"

#include "step/session.h"
#include "test.h"
#include "unit/case_knee.h"

#include <string.h>

static struct scene *scene;

static int make_scene(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    return scene_create(&knee, &scene, NULL) == RESULT_OK ? 0 : -1;
}

static int drop_scene(void **state) {
    (void)state;
    scene_destroy(&scene);
    return 0;
}

// A burr half sunk into the middle of the upper face, 2 mm deep, and far from every vertex.
static void the_distance_from_a_cut_to_the_touch_is_that_to_the_nearest_face(void **state) {
    (void)state;
    struct operation *operation = operation_create(scene, RULES_NEWEST);
    pose tip = {quat_identity(), {-25, 0, -11}};
    struct job job = {
        .id = 1, .kind = JOB_CUT, .move_count = 1, .moves = {{BLADE_SHAVER, {tip, tip}, {0}}}};
    struct job_result *result = operation_run(operation, &job);
    assert_int_equal(result->outcome, JOB_DONE);
    assert_near(result->figures.removed_mm3, 2.0 / 3 * M_PI * 8, 2);
    assert_near(result->figures.distance_mm, 2, 0.2);
    job_result_destroy(&result);
    operation_destroy(&operation);
}

static void a_blade_that_cannot_be_made_counts_as_refused(void **state) {
    (void)state;
    struct operation *operation = operation_create(scene, RULES_NEWEST);
    pose near = {quat_identity(), {-25, 0, -11}}, far = {quat_identity(), {0, 0, 250e3}};
    struct job job = {.id = 1, .kind = JOB_CUT, .move_count = 1};
    for (uint32_t i = 1; i <= 3; i++) {
        job.move_count = (int)i; // one cut of several moves, none of which can be made
        for (int k = 0; k < job.move_count; k++)
            job.moves[k] = (struct blade_move){BLADE_SHAVER, {far, far}, {0}};
        struct job_result *result = operation_run(operation, &job);
        assert_int_equal(result->outcome, JOB_REFUSED);
        assert_int_equal(result->figures.refused, i * (i + 1) / 2);
        assert_non_null(strstr(result->why.text, "the shaver at 0.0,0.0,250000.0"));
        job_result_destroy(&result);
    }
    job.moves[2].T_mesh_tip[0] = job.moves[2].T_mesh_tip[1] = near;
    struct job_result *result = operation_run(operation, &job);
    assert_int_equal(result->outcome, JOB_DONE);
    assert_int_equal(result->figures.refused, 8);
    assert_int_equal(result->figures.cuts, 1);
    job_result_destroy(&result);
    operation_destroy(&operation);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_distance_from_a_cut_to_the_touch_is_that_to_the_nearest_face),
        cmocka_unit_test(a_blade_that_cannot_be_made_counts_as_refused),
    };
    return cmocka_run_group_tests_name("operation", tests, make_scene, drop_scene);
}
