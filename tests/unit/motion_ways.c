// Scripts that name landmarks, ways round the bones, and steps that cannot be played.
#include "generated.h"
#include "mesh/query.h"
#include "scene/moved_knee.h"
#include "unit/motion_scripts.h"
#include "winding.h"

#include <stdlib.h>
#include <string.h>

static struct knee_case *knee; // healthy, right

static int make_knee(void **state) {
    (void)state;
    knee = plain_knee(SIDE_RIGHT, 2, 0);
    return 0;
}

static int destroy_knee(void **state) {
    (void)state;
    case_destroy(&knee);
    return 0;
}

// Where the probe begins and ends to touch, in the mock-up's frame.
#define TOUCHES_MAX 16

static int touches_of(const struct motion *motion, vec3 out_ends[TOUCHES_MAX]) {
    int probe = tool_index(motion, CHANNEL_PROBE), count = 0;
    for (size_t r = 1; r < motion->row_count; r++) {
        const struct motion_row *row = &motion->rows[r];
        if (row->touch == row[-1].touch)
            continue;
        assert_true(count < TOUCHES_MAX);
        out_ends[count++] = row[row->touch ? 0 : -1].tools[probe].T_mockup_tip.translation;
    }
    return count;
}

static void assert_touches(const struct motion *motion, const vec3 *ends, int count,
                           double within) {
    vec3 found[TOUCHES_MAX];
    assert_int_equal(touches_of(motion, found), count);
    for (int i = 0; i < count; i++)
        if (!(vec3_distance(found[i], ends[i]) < within))
            fail_msg("touch %d: %.2f %.2f %.2f is not %.2f %.2f %.2f", i, found[i].x, found[i].y,
                     found[i].z, ends[i].x, ends[i].y, ends[i].z);
}

// ---- landmarks ----------------------------------------------------------------------------------

static const char on_landmarks[] =
    "[steps]\nflex = 40\napproach = probe anteromedial\n"
    "palpate = tibia plateau_medial -4 13 0 plateau_medial 9 9 0\n"
    "palpate = meniscus_medial horn_anterior_medial root_anterior_medial\n"
    "palpate = femur condyle_medial -4 10 4 condyle_medial 5 16 6\nwithdraw = probe\n";

static void a_script_of_landmarks_goes_with_a_knee_that_is_moved_or_mirrored(void **state) {
    (void)state;
    pose T = {quat_from_axis_angle((vec3){0.6, 0, 0.8}, 0.9), {40, -60, 90}};
    struct motion_script script;
    struct error err;
    assert_int_equal(load_text(on_landmarks, &script, &err), RESULT_OK);
    struct knee_case *still = plain_knee(SIDE_RIGHT, 2.4, 0);
    struct motion motion;
    vec3 ends[TOUCHES_MAX];
    still->patella_key_count = 0; // of its own path
    plan_script(still, &script, &motion);
    int count = touches_of(&motion, ends);
    assert_int_equal(count, 6);
    motion_fini(&motion);
    for (int mirror = 0; mirror < 2; mirror++) {
        struct knee_case *moved = plain_knee(SIDE_RIGHT, 2.4, 0);
        vec3 there[TOUCHES_MAX];
        move_knee(moved, T, mirror);
        for (int i = 0; i < moved->portal_count; i++) {
            struct case_portal *portal = &moved->portals[i];
            vec3 inside = vec3_add(portal->position, portal->direction);
            portal->position = moved_point(portal->position, T, mirror);
            portal->direction = vec3_sub(moved_point(inside, T, mirror), portal->position);
        }
        moved->patella_key_count = 0;
        for (int i = 0; i < count; i++)
            there[i] = moved_point(ends[i], T, mirror);
        plan_script(moved, &script, &motion);
        assert_touches(&motion, there, count, 0.2);
        motion_fini(&motion);
        case_destroy(&moved);
    }
    case_destroy(&still);
}

static void a_place_is_beside_its_landmark_by_the_offset(void **state) {
    (void)state;
    for (int side = 0; side < 2; side++) {
        struct knee_case *on = plain_knee(side ? SIDE_LEFT : SIDE_RIGHT, 3, 0);
        double lateral = side ? -1 : 1;
        struct case_landmark mark = {
            .name = "mark", .body = BODY_TIBIA, .at = {lateral * -20, 10, -22}, .by_hand = true};
        struct motion_script script;
        struct motion motion;
        struct error err;
        struct query *tibia;
        struct closest from, to;
        assert_int_equal(case_landmark_set(on, &mark, &err), RESULT_OK);
        assert_int_equal(load_text("[steps]\nflex = 20\napproach = probe anteromedial\n"
                                   "palpate = tibia mark -3 4 0 mark 5 3 0\nwithdraw = probe\n",
                                   &script, &err),
                         RESULT_OK);
        plan_script(on, &script, &motion);
        assert_int_equal(on->landmark_count, 1); // nothing was missing
        assert_int_equal(query_create(&case_group(on, "tibia")->mesh, &tibia, NULL), RESULT_OK);
        query_closest(tibia, (vec3){lateral * -23, 14, -22}, INFINITY, MESH_NONE, &from);
        query_closest(tibia, (vec3){lateral * -15, 13, -22}, INFINITY, MESH_NONE, &to);
        pose T = joint_to_pose(&on->joint, &motion.rows[motion.row_count - 1].joint);
        vec3 ends[] = {pose_apply(T, from.point), pose_apply(T, to.point)};
        assert_touches(&motion, ends, 2, 1e-3);
        query_destroy(&tibia);
        motion_fini(&motion);
        case_destroy(&on);
    }
}

// To the middle of the plateau the femur is in the way: in front of it the hand stops.
static void of_a_line_between_landmarks_the_hand_goes_as_far_as_it_comes(void **state) {
    (void)state;
    struct motion motion;
    vec3 ends[TOUCHES_MAX];
    plan_text(knee,
              "[steps]\nflex = 30\napproach = probe anteromedial\n"
              "palpate = tibia plateau_medial 0 16 0 plateau_medial\nwithdraw = probe\n",
              &motion);
    assert_int_equal(touches_of(&motion, ends), 2);
    vec3 middle = case_landmark(knee, "plateau_medial")->at;
    assert_true(vec3_distance(ends[0], ends[1]) > 4);
    pose T = body_pose(knee, &motion.rows[motion.row_count - 1].joint, BODY_TIBIA);
    assert_true(vec3_distance(pose_apply_inverse(T, ends[1]), middle) > 3);
    motion_fini(&motion);
}

// ---- ways round the bones
// -------------------------------------------------------------------------

static void assert_shaft_is_free(const struct motion_row *row, vec3 portal) {
    vec3 tip = row->tools[0].T_mockup_tip.translation;
    for (int body = 0; body < BODY_COUNT; body++) {
        const struct mesh *bone = &case_group(knee, body_name((enum body)body))->mesh;
        pose T = body_pose(knee, &row->joint, (enum body)body);
        for (double share = 0; share < 0.96; share += 0.19)
            if (is_inside(bone, pose_apply_inverse(T, vec3_lerp(portal, tip, share))))
                fail_msg("%.2f s: inside the %s", row->t_seconds, body_name((enum body)body));
    }
}

// A portal so near to the femur that a shaft 15 mm inside cannot turn from below it to before it.
static void a_shaft_goes_round_the_femur_from_one_target_to_the_next(void **state) {
    (void)state;
    struct case_portal before = knee->portals[1];
    struct motion motion;
    vec3 ends[TOUCHES_MAX];
    assert_string_equal(before.name, "anteromedial");
    knee->portals[1].position = (vec3){-18, 40, -14};
    knee->portals[1].direction = vec3_unit_or((vec3){10, -28, -6}, (vec3){0});
    plan_text(knee,
              "[steps]\nflex = 30\napproach = probe anteromedial\n"
              "palpate = tibia -20 15 -22 -22 14 -22\npalpate = femur -18 34 -5 -17 34 -6\n"
              "palpate = tibia -20 15 -22 -22 14 -22\nflex = 60\nwithdraw = probe\n",
              &motion);
    assert_int_equal(touches_of(&motion, ends), 6);
    for (size_t r = 0; r < motion.row_count; r += 7) {
        vec3 inward =
            vec3_sub(motion.rows[r].tools[0].T_mockup_tip.translation, knee->portals[1].position);
        if (vec3_dot(inward, knee->portals[1].direction) > 0)
            assert_shaft_is_free(&motion.rows[r], knee->portals[1].position);
    }
    motion_fini(&motion);
    knee->portals[1] = before;
}

// Of a bent knee the tibia's front comes to where the probe was.
static void a_hand_retreats_from_where_the_joint_brings_a_bone(void **state) {
    (void)state;
    struct case_portal before = knee->portals[1];
    struct motion motion;
    knee->portals[1].position = (vec3){-20, 30, -22};
    knee->portals[1].direction = vec3_unit_or((vec3){0, -10, -2}, (vec3){0});
    plan_text(knee, "[steps]\nflex = 60\napproach = probe anteromedial\nflex = 0\n", &motion);
    double deepest = 0;
    for (size_t r = 0; r < motion.row_count; r++) {
        const struct motion_row *row = &motion.rows[r];
        vec3 inward = vec3_sub(row->tools[0].T_mockup_tip.translation, knee->portals[1].position);
        double depth = vec3_dot(inward, knee->portals[1].direction);
        deepest = fmax(deepest, depth);
        if (depth > 0 && r % 7 == 0)
            assert_shaft_is_free(row, knee->portals[1].position);
    }
    assert_near(deepest, 15, 1e-6);
    assert_near(motion.rows[motion.row_count - 1].joint.flexion_deg, 0, 1e-9);
    motion_fini(&motion);
    knee->portals[1] = before;
}

static void a_joint_that_would_close_a_portal_is_refused(void **state) {
    (void)state;
    struct case_portal before = knee->portals[1];
    struct motion_script script;
    struct motion motion;
    struct error err = {""};
    knee->portals[1].position = (vec3){-10, 44, -8}; // before the patella's way
    knee->portals[1].direction = vec3_unit_or((vec3){0, -4, -1}, (vec3){0});
    assert_ok(load_text("[steps]\napproach = probe anteromedial\nflex = 100\n", &script, &err));
    assert_int_equal(motion_plan(knee, &script, &motion, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "step 2 (flex): the shaft through the portal anteromedial"));
    assert_non_null(strstr(err.text, "deep through the patella"));
    script.skips = true;
    script.steps[script.step_count++] = (struct motion_step){.verb = MOTION_VALGUS, .amount = 3};
    script.steps[script.step_count++] = (struct motion_step){
        .verb = MOTION_BITE, .tool = CHANNEL_PROBE, .name = "patella", .has_place = false};
    plan_script(knee, &script, &motion);
    assert_near(motion.rows[motion.row_count - 1].joint.flexion_deg, 0, 1e-9);
    assert_near(motion.rows[motion.row_count - 1].joint.varus_deg, -3, 1e-9);
    motion_fini(&motion);
    knee->portals[1] = before;
}

static void steps_that_cannot_be_played_are_left_out_if_the_script_says_so(void **state) {
    (void)state;
    struct motion with, without;
    plan_text(knee,
              "[motion]\nunreachable = skip\n[steps]\nflex = 30\nwithdraw = punch\n"
              "approach = probe anteromedial\npalpate = spleen 0 0 0 1 1 1\n"
              "palpate = tibia -20 13 -22 -20 -15 -22\n" // its end is out of reach
              "palpate = tibia plateau_medial -4 13 0 plateau_medial 9 9 0\nwithdraw = probe\n",
              &with);
    plan_text(knee,
              "[steps]\nflex = 30\napproach = probe anteromedial\n"
              "palpate = tibia plateau_medial -4 13 0 plateau_medial 9 9 0\nwithdraw = probe\n",
              &without);
    assert_int_equal(without.skipped_count, 0);
    assert_int_equal(with.skipped_count, 3);
    assert_string_equal(with.skipped[0].text,
                        "step 2 (withdraw): punch is not inside: approach first");
    assert_string_equal(with.skipped[1].text, "step 4 (palpate): the case has no group spleen");
    assert_non_null(strstr(with.skipped[2].text, "step 5 (palpate): the shaft through"));
    char *texts[2] = {written(&with), written(&without)};
    assert_string_equal(texts[0], texts[1]);
    free(texts[0]);
    free(texts[1]);
    motion_fini(&with);
    motion_fini(&without);
}

// Turned round, the femur has no condyles behind: no landmark is found, and the rest is played.
static void a_case_on_which_no_landmark_is_found_is_played_without_those_steps(void **state) {
    (void)state;
    struct knee_case *odd = plain_knee(SIDE_RIGHT, 3, 0);
    struct motion_script script;
    struct motion motion;
    struct error err = {""};
    static const char steps[] = "[steps]\napproach = probe anteromedial\n"
                                "palpate = tibia plateau_medial 0 14 0 plateau_medial 0 10 0\n"
                                "bite = probe patella\nwithdraw = probe\n";
    odd->joint.T_femur_joint.rotation = quat_from_axis_angle((vec3){0, 1, 0}, 3.1415926);
    assert_ok(load_text(steps, &script, &err));
    assert_int_equal(motion_plan(odd, &script, &motion, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "the case lacks landmarks or portals, and none are found"));
    script.skips = true;
    plan_script(odd, &script, &motion);
    assert_int_equal(motion.skipped_count, 1);
    assert_non_null(strstr(motion.skipped[0].text, "the case has no landmark plateau_medial"));
    motion_fini(&motion);
    case_destroy(&odd);
}

static void a_script_of_which_nothing_can_be_played_is_refused(void **state) {
    (void)state;
    struct motion_script script;
    struct motion motion;
    struct error err = {""};
    assert_ok(load_text("[motion]\nunreachable = skip\n[steps]\nflex = 10\n"
                        "approach = probe anteromedial\npalpate = spleen 0 0 0 1 1 1\n",
                        &script, &err));
    assert_int_equal(motion_plan(knee, &script, &motion, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "step 3 (palpate): the case has no group spleen"));
}

// ---- turning the optic --------------------------------------------------------------------------

static const char stand[] = "[steps]\nflex = 20\napproach = scope anterolateral\n"
                            "stand = tibia horn_anterior_medial horn_anterior_lateral\n";

static pose scope_at_the_end(const char *turn, struct motion *motion) {
    char text[512];
    snprintf(text, sizeof text, "%s%s", stand, turn);
    plan_text(knee, text, motion);
    return motion->rows[motion->row_count - 1].tools[0].T_mockup_tip;
}

static double off_axis_deg(const struct motion *motion, pose T_mockup_scope, const char *name) {
    const struct motion_row *row = &motion->rows[motion->row_count - 1];
    const struct case_landmark *landmark = case_landmark(knee, name);
    vec3 place = pose_apply(body_pose(knee, &row->joint, landmark->body), landmark->at);
    vec3 axis =
        quat_rotate(quat_from_axis_angle((vec3){1, 0, 0}, -30 * RAD_PER_DEG), (vec3){0, 0, 1});
    axis = quat_rotate(T_mockup_scope.rotation, axis);
    vec3 way = vec3_sub(place, T_mockup_scope.translation);
    return DEG_PER_RAD * atan2(vec3_length(vec3_cross(axis, way)), vec3_dot(axis, way));
}

static void an_optic_turns_from_place_to_place_where_the_scope_stands(void **state) {
    (void)state;
    static const char *const names[] = {"horn_anterior_medial", "horn_anterior_lateral"};
    pose scopes[2];
    for (int i = 0; i < 2; i++) {
        char turn[128];
        struct motion motion;
        snprintf(turn, sizeof turn, "turn = tibia %s\n", names[i]);
        scopes[i] = scope_at_the_end(turn, &motion);
        assert_true(off_axis_deg(&motion, scopes[i], names[i]) < 25);
        assert_true(off_axis_deg(&motion, scopes[i], names[1 - i]) >
                    off_axis_deg(&motion, scopes[i], names[i]));
        motion_fini(&motion);
    }
    assert_vec3_near(scopes[0].translation, scopes[1].translation, 1e-9);
    vec3 shaft = {0, 0, 1};
    assert_vec3_near(quat_rotate(scopes[0].rotation, shaft), quat_rotate(scopes[1].rotation, shaft),
                     1e-9);
    assert_true(quat_angle(scopes[0].rotation, scopes[1].rotation) > 0.3);
}

static void who_can_stand_nowhere_is_told_so(void **state) {
    (void)state;
    struct motion_script script;
    struct motion motion;
    struct error err;
    assert_ok(load_text("[steps]\nflex = 20\napproach = scope anterolateral\n"
                        "stand = tibia patella root_posterior_medial\n",
                        &script, &err));
    assert_int_equal(motion_plan(knee, &script, &motion, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "step 3 (stand): through the portal anterolateral, from "
                                     "nowhere does the optic turn from patella to "
                                     "root_posterior_medial"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_script_of_landmarks_goes_with_a_knee_that_is_moved_or_mirrored),
        cmocka_unit_test(a_place_is_beside_its_landmark_by_the_offset),
        cmocka_unit_test(of_a_line_between_landmarks_the_hand_goes_as_far_as_it_comes),
        cmocka_unit_test(a_shaft_goes_round_the_femur_from_one_target_to_the_next),
        cmocka_unit_test(a_hand_retreats_from_where_the_joint_brings_a_bone),
        cmocka_unit_test(a_joint_that_would_close_a_portal_is_refused),
        cmocka_unit_test(steps_that_cannot_be_played_are_left_out_if_the_script_says_so),
        cmocka_unit_test(a_case_on_which_no_landmark_is_found_is_played_without_those_steps),
        cmocka_unit_test(a_script_of_which_nothing_can_be_played_is_refused),
        cmocka_unit_test(an_optic_turns_from_place_to_place_where_the_scope_stands),
        cmocka_unit_test(who_can_stand_nowhere_is_told_so),
    };
    return cmocka_run_group_tests(tests, make_knee, destroy_knee);
}
