// The script of a resection on a torn knee.
#include "generate/generate.h"
#include "mesh/query.h"
#include "motion_scripts.h"
#include "winding.h"

#include <stdlib.h>

static struct knee_case *torn; // a right knee with a radial tear

static struct knee_case *torn_knee(enum side side) {
    struct recipe recipe;
    struct knee_case *made;
    struct error err;
    if (recipe_load(ARTHRON_SOURCE "/cases/tear-radial", &recipe, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    recipe.side = side;
    if (generate_knee(&recipe, &made, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return made;
}

static void plan_file(const char *path, struct knee_case *on, double tremor_mm,
                      struct motion *out_motion) {
    struct motion_script script;
    struct error err;
    if (motion_script_load(path, &script, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    script.tremor_mm = tremor_mm;
    if (motion_plan(on, &script, out_motion, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

static void plan_resection(struct knee_case *on, double tremor_mm, struct motion *out_motion) {
    plan_file(ARTHRON_SOURCE "/cases/motions/resection.ini", on, tremor_mm, out_motion);
}

static bool is_planned(const struct case_group *group, vec3 p) {
    for (int i = 0; i < group->lesion.plan.part_count; i++)
        if (convex_contains(&group->lesion.plan.parts[i], p))
            return true;
    return false;
}

// What lies between the jaws as they close: of the plane between them, 3.5 mm wide and 5 mm long,
// lifted by a share of the jaws' angle.
static vec3 between_jaws(pose T_tibia_tip, int i) {
    double x = -1.5 + 0.5 * (i % 7), z = -4.5 + 0.5 * (i / 7 % 9), angle = 0.06 * (i / 63);
    return pose_apply(T_tibia_tip, (vec3){x, (z + 6) * sin(angle), (z + 6) * cos(angle) - 6});
}

static void bites_have_planned_tissue_between_jaws_that_open_upwards(void **state) {
    (void)state;
    const struct case_group *group = case_group(torn, "meniscus_medial");
    struct motion motion;
    plan_resection(torn, 0, &motion);
    int punch = tool_index(&motion, CHANNEL_PUNCH), bites = 0;
    int planned = 0, unplanned = 0;
    struct query *query;
    assert_int_equal(query_create(&group->mesh, &query, NULL), RESULT_OK);
    for (size_t r = 1; r < motion.row_count; r++) {
        const struct motion_tool_state *state_now = &motion.rows[r].tools[punch];
        if (!(motion.rows[r - 1].tools[punch].opening > 0 && state_now->opening == 0))
            continue;
        bites++;
        pose T = joint_to_pose(&torn->joint, &motion.rows[r].joint);
        pose T_tibia_tip = pose_compose(pose_inverse(T), state_now->T_mockup_tip);
        assert_true(quat_rotate(T_tibia_tip.rotation, (vec3){0, 1, 0}).z > 0.9);
        struct closest closest;
        assert_true(query_closest(query, T_tibia_tip.translation, 1, MESH_NONE, &closest));
        assert_true(closest.distance < 1e-5); // the tip touches the mock-up's meniscus
        int tissue = 0;
        for (int i = 0; i < 63 * 10; i++) {
            vec3 p = between_jaws(T_tibia_tip, i);
            if (!is_inside(&group->mesh, p))
                continue;
            tissue++;
            *(is_planned(group, p) ? &planned : &unplanned) += 1;
        }
        assert_true(tissue > 20);
        assert_false(is_inside(&group->mesh,
                               pose_apply(T_tibia_tip, (vec3){0, 1, -6}))); // the hinge is free
    }
    assert_true(bites >= 6 && bites <= 15);
    assert_true(planned > 4 * unplanned);
    query_destroy(&query);
    motion_fini(&motion);
}

static void a_shaver_runs_along_the_margin_and_a_probe_feels_it(void **state) {
    (void)state;
    const struct mesh *mesh = &case_group(torn, "meniscus_medial")->mesh;
    struct query *query;
    assert_int_equal(query_create(mesh, &query, NULL), RESULT_OK);
    struct motion motion;
    plan_resection(torn, 0, &motion);
    int shaver = tool_index(&motion, CHANNEL_SHAVER), runs = 0, touches = 0;
    vec3 first = {0}, last = {0};
    for (size_t r = 0; r < motion.row_count; r++) {
        const struct motion_row *row = &motion.rows[r];
        touches += row->touch != NULL;
        if (row->tools[shaver].opening == 0)
            continue;
        assert_near(row->tools[shaver].opening, 1, 0);
        pose T = joint_to_pose(&torn->joint, &row->joint);
        vec3 p = pose_apply_inverse(T, row->tools[shaver].T_mockup_tip.translation);
        struct closest closest;
        assert_true(query_closest(query, p, INFINITY, MESH_NONE, &closest));
        assert_true(closest.distance > 0.5 && closest.distance < 1.5);
        first = runs++ ? first : p;
        last = p;
    }
    assert_true(runs > 30 && touches > 60);
    assert_true(vec3_distance(first, last) > 8);
    query_destroy(&query);
    motion_fini(&motion);
}

static void a_left_knee_is_operated_on_mirrored(void **state) {
    (void)state;
    struct knee_case *left = torn_knee(SIDE_LEFT), *knees[2] = {torn, left};
    struct motion motions[2];
    for (int i = 0; i < 2; i++)
        plan_resection(knees[i], 0, &motions[i]);
    assert_int_equal(motions[0].row_count, motions[1].row_count);
    for (size_t r = 0; r < motions[0].row_count; r += 10)
        for (int i = 0; i < motions[0].tool_count; i++) {
            vec3 p = motions[0].rows[r].tools[i].T_mockup_tip.translation;
            vec3 q = motions[1].rows[r].tools[i].T_mockup_tip.translation;
            assert_vec3_near(p, ((vec3){-q.x, q.y, q.z}), 0.02);
        }
    for (int i = 0; i < 2; i++)
        motion_fini(&motions[i]);
    case_destroy(&left);
}

static void the_same_resection_gives_the_same_bytes(void **state) {
    (void)state;
    char *texts[2];
    for (int i = 0; i < 2; i++) {
        struct motion motion;
        plan_resection(torn, 0.05, &motion);
        texts[i] = written(&motion);
        motion_fini(&motion);
    }
    assert_string_equal(texts[0], texts[1]);
    free(texts[0]);
    free(texts[1]);
}

static int make_torn(void **state) {
    (void)state;
    torn = torn_knee(SIDE_RIGHT);
    return 0;
}

static int destroy_torn(void **state) {
    (void)state;
    case_destroy(&torn);
    return 0;
}

// By the definition in docs/METRICS.md, not by the room that measures it.
static double degrees_off_sight(pose scope, vec3 p) {
    vec3 sight = quat_rotate(scope.rotation, (vec3){0, 0.5, sqrt(0.75)});
    vec3 way = vec3_sub(p, scope.translation);
    return acos(vec3_dot(sight, way) / vec3_length(way)) / RAD_PER_DEG;
}

static void a_lesson_is_cut_under_the_eye_of_the_scope(void **state) {
    (void)state;
    for (enum side side = SIDE_RIGHT; side <= SIDE_LEFT; side++) {
        struct knee_case *on = torn_knee(side);
        struct motion motion;
        int bites = 0;
        plan_file(ARTHRON_SOURCE "/cases/motions/lesson.ini", on, 0, &motion);
        int punch = tool_index(&motion, CHANNEL_PUNCH), scope = tool_index(&motion, CHANNEL_SCOPE);
        assert_true(vec3_distance(motion.tools[punch].portal, motion.tools[scope].portal) > 20);
        for (size_t r = 1; r < motion.row_count; r++) {
            const struct motion_tool_state *now = motion.rows[r].tools;
            if (!(motion.rows[r - 1].tools[punch].opening > 0 && now[punch].opening == 0))
                continue;
            vec3 tip = now[punch].T_mockup_tip.translation;
            assert_true(degrees_off_sight(now[scope].T_mockup_tip, tip) < 45);
            assert_true(vec3_distance(now[scope].T_mockup_tip.translation, tip) < 30);
            bites++;
        }
        assert_true(bites >= 5);
        motion_fini(&motion);
        case_destroy(&on);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lesson_is_cut_under_the_eye_of_the_scope),
        cmocka_unit_test(bites_have_planned_tissue_between_jaws_that_open_upwards),
        cmocka_unit_test(a_shaver_runs_along_the_margin_and_a_probe_feels_it),
        cmocka_unit_test(a_left_knee_is_operated_on_mirrored),
        cmocka_unit_test(the_same_resection_gives_the_same_bytes),
    };
    return cmocka_run_group_tests(tests, make_torn, destroy_torn);
}
