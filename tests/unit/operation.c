// What an operation tells of a cut, where it can be told by hand: on a meniscus that is a box.
#include "step/operation.h"

#include "base/clock.h"
#include "step/fields.h"
#include "step/session.h"
#include "test.h"
#include "unit/case_knee.h"

#include <stdlib.h>
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
    struct operation *operation = operation_create(scene, RULES_NEWEST, instruments_usual());
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
    struct operation *operation = operation_create(scene, RULES_NEWEST, instruments_usual());
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

// Else a case could take all memory at its first cut.
static void what_is_as_long_as_no_tissue_is_refused_with_its_group(void **state) {
    (void)state;
    for (int side = 0; side < 3; side++) {
        struct knee_case *knee = box_knee();
        struct mesh *mesh = &case_group(knee, "meniscus_medial")->mesh;
        struct scene *vast = NULL;
        struct error err = {""};
        for (uint32_t v = 0; v < mesh->vertex_count; v++)
            mesh->positions[3 * v + (uint32_t)side] *= 100;
        assert_int_equal(scene_create(&knee, &vast, &err), RESULT_LIMIT);
        assert_non_null(strstr(err.text, "group meniscus_medial: it is "));
        assert_non_null(strstr(err.text, "500 mm at most"));
        case_destroy(&knee);
    }
}

// Without S'_max the touch stays, and all that a cut takes is touched and not seen.
static void what_never_gives_way_is_touched_where_it_is_gone(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct case_group *group = case_group(knee, "meniscus_medial");
    struct scene *still;
    free(group->maxcut);
    group->maxcut = NULL;
    assert_int_equal(scene_create(&knee, &still, NULL), RESULT_OK);
    for (int rules = RULES_STILL_TOLD - 1; rules <= RULES_STILL_TOLD; rules++) {
        struct operation *operation = operation_create(still, rules, instruments_usual());
        pose tip = {quat_identity(), {-25, 0, -11}};
        struct job job = {
            .id = 1, .kind = JOB_CUT, .move_count = 1, .moves = {{BLADE_SHAVER, {tip, tip}, {0}}}};
        struct job_result *result = operation_run(operation, &job);
        assert_int_equal(result->outcome, JOB_DONE);
        assert_near(result->figures.touched_unseen_mm3,
                    rules < RULES_STILL_TOLD ? 0 : result->figures.removed_mm3, 1e-9);
        uint32_t count = cut_mesh_vertex_bound(operation_mesh(operation, 0));
        double *mm = calloc(count, sizeof *mm), deepest = 0;
        operation_mismatch(operation, 0, mm);
        for (uint32_t v = 0; v < count; v++)
            deepest = fmax(deepest, mm[v]);
        assert_near(deepest, 2, 0.1);
        free(mm);
        job_result_destroy(&result);
        operation_destroy(&operation);
    }
    scene_destroy(&still);
}

static struct blade_move burr_down(double x, double y) {
    pose from = {quat_identity(), {x, y, -10}}, to = {quat_identity(), {x, y, -18}};
    return (struct blade_move){BLADE_SHAVER, {from, to}, {0}};
}

// A flap that tears leave on a bridge of 1.5 mm. The touch follows the tissue without its clefts,
// and when the burr has taken the bridge, without the flap.
static void a_flap_that_tears_let_come_off_is_no_longer_touched(void **state) {
    (void)state;
    struct plane along[] = {{{1, 0, 0}, -21.95}, {{-1, 0, 0}, 22.05}, {{0, 1, 0}, 13.5},
                            {{0, -1, 0}, -1.95}, {{0, 0, 1}, -12},    {{0, 0, -1}, 20}};
    struct knee_case *knee = box_knee();
    struct case_group *group = case_group(knee, "meniscus_medial");
    struct scene *torn;
    struct error err;
    assert_ok(case_region_add(&group->lesion.tear, along, 6, &err));
    assert_ok(scene_create(&knee, &torn, &err));
    struct operation *operation = operation_create(torn, RULES_NEWEST, instruments_usual());
    struct job job = {.id = 1, .kind = JOB_CUT, .stroke = 1, .move_count = 1};
    job.moves[0] = burr_down(-31, 0); // beside the tears
    struct job_result *result = operation_run(operation, &job);
    struct tissue_figures f = result->figures;
    double clefts_mm3 = 6 * (4 * 0.125 + 0.1 * (13.5 - 2.0625));
    assert_int_equal(f.pieces, 0);
    assert_near(f.warped_mm3 - f.left_mm3, f.volume_mm3 + clefts_mm3, 1e-3);
    job_result_destroy(&result);
    job.stroke = 2;
    job.moves[0] = burr_down(-22, 14.5);
    result = operation_run(operation, &job);
    f = result->figures;
    assert_int_equal(f.pieces, 1);
    assert_true(f.pieces_mm3 > 100);
    assert_near(f.warped_mm3 - f.left_mm3, f.volume_mm3, 1e-6);
    job_result_destroy(&result);
    result = operation_run(operation, &(struct job){.id = 2, .kind = JOB_UNDO});
    assert_near(result->figures.warped_mm3 - result->figures.left_mm3,
                result->figures.volume_mm3 + clefts_mm3, 1e-3);
    job_result_destroy(&result);
    operation_destroy(&operation);
    scene_destroy(&torn);
}

static void sessions_share_a_tissue_until_one_of_them_cuts_it(void **state) {
    (void)state;
    struct operation *one = operation_create(scene, RULES_NEWEST, instruments_usual());
    struct operation *other = operation_create(scene, RULES_NEWEST, instruments_usual());
    const struct cut_mesh *shared = scene_tissue_mesh(scene, 0);
    double whole_mm3 = cut_mesh_volume(shared), moved[3];
    pose tip = {quat_identity(), {-25, 0, -11}};
    struct job job = {
        .id = 1, .kind = JOB_CUT, .move_count = 1, .moves = {{BLADE_SHAVER, {tip, tip}, {0}}}};
    assert_ptr_equal(operation_mesh(one, 0), shared);
    struct job_result *result = operation_run(one, &job);
    assert_int_equal(result->outcome, JOB_DONE);
    assert_ptr_not_equal(operation_mesh(one, 0), shared);
    assert_true(cut_mesh_volume(operation_mesh(one, 0)) < whole_mm3 - 10);
    assert_ptr_equal(operation_mesh(other, 0), shared);
    assert_true(cut_mesh_volume(shared) == whole_mm3);
    operation_touch(other, 0, result->touch.vertices[0], moved);
    assert_true(moved[0] == 0 && moved[1] == 0 && moved[2] == 0);
    job_result_destroy(&result);
    job = (struct job){.id = 2, .kind = JOB_RESTORE};
    result = operation_run(one, &job);
    assert_int_equal(result->figures.mesh_number, 3);
    assert_true(result->figures.volume_mm3 == whole_mm3);
    assert_ptr_equal(operation_mesh(one, 0), shared);
    job_result_destroy(&result);
    operation_destroy(&one);
    operation_destroy(&other);
}

// A step of a session that rests says what the one before did.
static void a_session_rests_once_its_hands_are_lost(void **state) {
    (void)state;
    struct session_settings settings = session_settings_default();
    struct session *session = session_create(scene, &settings);
    struct session_output out[2];
    struct session_input input = {.kind = INPUT_START, .time_ns = NS_PER_S};
    session_step(session, &input, &out[0]);
    assert_true(session_rests(session));
    input = (struct session_input){.kind = INPUT_FRAME, .time_ns = 2 * NS_PER_S};
    input.frame = (struct frame){.number = 1, .time_ns = 2 * NS_PER_S, .count = 1};
    input.frame.samples[0] = (struct sample){.channel = CHANNEL_PROBE,
                                             .kind = SAMPLE_POSE,
                                             .time_ns = 2 * NS_PER_S,
                                             .T_mockup_body = {quat_identity(), {-25, 0, 5}}};
    session_step(session, &input, &out[0]);
    assert_true(out[0].instruments[0].present);
    assert_false(session_rests(session));
    for (int i = 0; i < 2; i++) {
        input = (struct session_input){.kind = INPUT_EMPTY, .time_ns = (9 + i) * NS_PER_S};
        session_step(session, &input, &out[i]);
        assert_true(session_rests(session));
    }
    out[1].step = out[0].step;
    out[1].time_ns = out[0].time_ns;
    out[0].events = 0; // that the probe was lost
    assert_true(output_hash(1, &out[0], RULES_NEWEST) == output_hash(1, &out[1], RULES_NEWEST));
    session_destroy(&session);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_distance_from_a_cut_to_the_touch_is_that_to_the_nearest_face),
        cmocka_unit_test(a_flap_that_tears_let_come_off_is_no_longer_touched),
        cmocka_unit_test(a_blade_that_cannot_be_made_counts_as_refused),
        cmocka_unit_test(what_never_gives_way_is_touched_where_it_is_gone),
        cmocka_unit_test(what_is_as_long_as_no_tissue_is_refused_with_its_group),
        cmocka_unit_test(sessions_share_a_tissue_until_one_of_them_cuts_it),
        cmocka_unit_test(a_session_rests_once_its_hands_are_lost),
    };
    return cmocka_run_group_tests_name("operation", tests, make_scene, drop_scene);
}
