// A meniscus that is cut through: where nothing of it is left, the touch lies down
// (match/conform.h).
#include "scene/hand.h"
#include "step/settings.h"
#include "test.h"

#define MEDIAL 0
#define LAYERS 9

// A burr crosses the body of the meniscus, layer by layer.
static struct job burr_through(void) {
    struct job job = {.id = 1, .kind = JOB_CUT, .stroke = 1, .move_count = LAYERS};
    for (int i = 0; i < LAYERS; i++) {
        vec3 at = vec3_add(inner, (vec3){0, 0, 8 - 2 * i});
        pose from = {quat_identity(), vec3_add_scaled(at, -4, outward)}, to = from;
        to.translation = vec3_add_scaled(at, 20, outward);
        job.moves[i] = (struct blade_move){BLADE_SHAVER, {from, to}, {0}};
    }
    return job;
}

static double cut(struct operation *operation, uint64_t *out_touch) {
    struct job job = burr_through();
    struct job_result *result = operation_run(operation, &job);
    assert_int_equal(result->tissue, MEDIAL);
    assert_int_equal(result->figures.pieces, 1);
    double gone = result->figures.removed_mm3 + result->figures.pieces_mm3;
    double felt = result->figures.touched_unseen_mm3;
    *out_touch = result->touch_hash;
    job_result_destroy(&result);
    return felt / gone;
}

static void the_touch_of_what_is_gone_lies_down_from_rules_7_on(void **state) {
    (void)state;
    uint64_t touch;
    struct operation *before = operation_create(scene, RULES_TOUCH_LAID - 1, instruments_usual());
    struct operation *now = operation_create(scene, RULES_TOUCH_LAID, instruments_usual());
    double felt_before = cut(before, &touch), felt_now = cut(now, &touch);
    print_message("%.3f of what is gone was felt, and %.3f is\n", felt_before, felt_now);
    assert_true(felt_before > 0.3);
    assert_true(felt_now < 0.2);
    operation_destroy(&before);
    operation_destroy(&now);
}

static void an_undo_brings_back_the_touch_and_the_same_cut_lays_it_down_again(void **state) {
    (void)state;
    struct operation *operation = operation_create(scene, RULES_NEWEST, instruments_usual());
    uint64_t first, again;
    cut(operation, &first);
    struct job_result *result = operation_run(operation, &(struct job){.id = 2, .kind = JOB_UNDO});
    job_result_destroy(&result);
    for (uint32_t v = 0; v < meniscus->mesh.vertex_count; v++) {
        double offset[3];
        operation_touch(operation, MEDIAL, v, offset);
        assert_true(offset[0] == 0 && offset[1] == 0 && offset[2] == 0);
    }
    cut(operation, &again);
    assert_true(first == again);
    operation_destroy(&operation);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_touch_of_what_is_gone_lies_down_from_rules_7_on),
        cmocka_unit_test(an_undo_brings_back_the_touch_and_the_same_cut_lays_it_down_again),
    };
    return cmocka_run_group_tests_name("through", tests, hand_make_scene, hand_drop_scene);
}
