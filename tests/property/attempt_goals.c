// Goals of a task: each met once, and just missed.
#include "attempt_body.h"

#include <string.h>

static void a_landmark_is_seen(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nwithin_mm = 45\nbeyond_mm = 25\nhold_s = 0.2\n");
    see_patella(40);
    steps(20);
    assert_int_equal(attempt.goals_met, 0); // not long enough yet
    assert_int_equal(steps(2).goals_met, 1);
    assert_int_equal(attempt.end, ATTEMPT_DONE);
    assert_int_equal(attempt_verdict(&attempt, &task), VERDICT_PASSED);

    attempt_init(&attempt);
    see_patella(70); // too far
    assert_int_equal(steps(50).goals_met, 0);
    see_patella(10); // too near
    assert_int_equal(steps(50).goals_met, 0);
    vec3 p = landmark("patella"), from = vec3_add_scaled(p, 40, forward);
    place(SCOPE, looking(from, vec3_add(from, (vec3){1, 0, 0}))); // beside the picture
    assert_int_equal(steps(50).goals_met, 0);
    output.instruments[SCOPE].present = false;
    assert_int_equal(steps(50).goals_met, 0);
}

static void what_a_bone_hides_is_not_seen(void **state) {
    (void)state;
    begin("[goal a]\nsee = notch\nwithin_mm = 100\nhold_s = 0.1\n");
    vec3 p = landmark("notch");
    place(SCOPE, looking(vec3_add_scaled(p, 60, (vec3){1, 0, 0}), p)); // through a condyle
    assert_int_equal(steps(50).goals_met, 0);
    output.T_mockup_virtual[BODY_TIBIA].translation.z = -60;
    place(SCOPE, looking(vec3_add_scaled(p, 25, (vec3){0, 0.3, -1}), p)); // from below
    assert_int_equal(steps(50).goals_met, 1);
}

static void tissue_that_was_cut_hides_nothing(void **state) {
    (void)state;
    begin("[goal a]\nsee = plateau_medial\nwithin_mm = 100\nhold_s = 0.1\n");
    vec3 p = landmark("plateau_medial");
    output.T_mockup_virtual[BODY_FEMUR].translation.z = 200;
    place(SCOPE, looking(vec3_add_scaled(p, 30, (vec3){-1, 0, 0.05}), p)); // through the meniscus
    assert_int_equal(steps(50).goals_met, 0);
    land(0, 0, 0, 0);
    assert_int_equal(steps(50).goals_met, 1);
}

static void a_picture_has_to_be_upright(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nupright_deg = 20\nhold_s = 0.1\n");
    vec3 p = landmark("patella");
    pose straight = looking(vec3_add_scaled(p, 20, forward), p);
    for (int deg = 0; deg < 360; deg += 15) {
        pose turned = straight;
        quat roll = quat_from_axis_angle((vec3){0, 0, 1}, deg * RAD_PER_DEG);
        turned.rotation = quat_multiply(straight.rotation, roll);
        place(SCOPE, turned);
        attempt_init(&attempt);
        assert_int_equal(steps(20).goals_met, deg <= 15 || deg >= 345);
    }
}

static void a_scope_has_to_be_still(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nstill_mm = 2\nhold_s = 1\n");
    vec3 p = landmark("patella"), from = vec3_add_scaled(p, 20, forward);
    for (int i = 0; i < 40; i++) {
        place(SCOPE, looking(vec3_add_scaled(from, 0.15 * i, (vec3){1, 0, 0}), p));
        assert_int_equal(steps(5).goals_met, 0); // 3 mm in each second
    }
    assert_int_equal(steps(101).goals_met, 1);
}

static void a_landmark_is_touched_in_view(void **state) {
    (void)state;
    begin("[goal a]\ntouch = plateau_medial\nreach_mm = 3\nin_view = yes\nhold_s = 0.2\n");
    vec3 at = landmark("plateau_medial");
    pose seen = looking(vec3_add_scaled(at, 15, (vec3){0, 1, 0.5}), at);
    place(SCOPE, seen);
    touch(PROBE, "tibia", at, 1.1, 0); // not on it
    assert_int_equal(steps(50).goals_met, 0);
    touch(PROBE, "femur", at, 0, 0); // on something else
    assert_int_equal(steps(50).goals_met, 0);
    touch(PROBE, "tibia", vec3_add(at, (vec3){3.1, 0, 0}), 0, 0); // beside it
    assert_int_equal(steps(50).goals_met, 0);
    touch(PROBE, "tibia", vec3_add(at, (vec3){2.9, 0, 0}), 0.9, 0);
    place(SCOPE, looking(seen.translation, vec3_add(seen.translation, forward))); // not in view
    assert_int_equal(steps(50).goals_met, 0);
    place(SCOPE, seen);
    assert_int_equal(steps(21).goals_met, 1);
}

static void a_line_is_followed_from_end_to_end(void **state) {
    (void)state;
    begin("[goal a]\nfollow = horn_anterior_medial body_medial\nreach_mm = 2\n");
    const struct site_goal *g = site_goal(site, 0);
    assert_true(g->line_count > 5);
    touch(PROBE, "meniscus_medial", g->line[g->line_count - 1], 0, 0); // the end first
    assert_int_equal(steps(5).goals_met, 0);
    for (int i = 0; i < g->line_count - 3; i++) {
        touch(PROBE, "meniscus_medial", g->line[i], 0, 0);
        assert_int_equal(steps(1).goals_met, 0);
    }
    touch(PROBE, "meniscus_medial", g->line[g->line_count - 1], 1.5, 0); // in the air
    assert_int_equal(steps(5).goals_met, 0);
    touch(PROBE, "meniscus_medial", g->line[g->line_count - 1], 0, 0);
    assert_int_equal(steps(1).goals_met, 1);
}

static void a_joint_is_held(void **state) {
    (void)state;
    begin("[goal a]\nvalgus_deg = 4\nflexion_deg = 10 30\nhold_s = 0.1\n"
          "[goal b]\ndrawer_mm = 5\nhold_s = 0.1\n");
    bend(20, 3.9, 0);
    assert_int_equal(steps(50).goals_met, 0);
    bend(31, 5, 0);
    assert_int_equal(steps(50).goals_met, 0);
    bend(29, 4.1, 6);
    assert_int_equal(steps(11).goals_met, 1); // b comes after it
    bend(90, 0, 4.9);
    assert_int_equal(steps(50).goals_met, 0);
    bend(90, 0, 5.1);
    assert_int_equal(steps(11).goals_met, 2);
}

static void a_resection_is_to_plan(void **state) {
    (void)state;
    begin("[goal a]\nresect = meniscus_medial\nunder_share = 0.1\nover_share = 0.2\nrim_mm = 3\n"
          "step_mm = 1\n"
          "hold_s = 0.1\n[error beyond]\nover_share = 0.3\n");
    assert_int_equal(steps(50).goals_met, 0); // nothing was cut
    land(10.1, 0, 5, 0);
    assert_int_equal(steps(50).goals_met, 0);
    land(5, 20.1, 5, 0);
    assert_int_equal(steps(50).goals_met, 0);
    land(5, 15, 2.9, 0);
    assert_int_equal(steps(50).goals_met, 0);
    land(5, 15, 5, 1.1);
    assert_int_equal(steps(50).goals_met, 0);
    assert_int_equal(attempt.errors, 0);
    land(5, 31, 5, 0);
    steps(50);
    assert_int_equal(attempt.errors, 1);
    assert_int_equal(attempt.occurrences[0].tool, -1);
    land(10, 20, 3, 1);
    assert_int_equal(steps(20).goals_met, 1);
    assert_int_equal(attempt_verdict(&attempt, &task), VERDICT_NOT_YET); // by the error
}

static void a_loose_body_is_taken_out(void **state) {
    (void)state;
    begin("[goal one]\ntake_out = piece_2\n[goal every]\ntake_out = all\n");
    task.in_order = false;
    loose(0, LOOSE_OUT);
    loose(1, LOOSE_HELD);
    assert_int_equal(steps(100).goals_met, 0); // one is out, and another one in the jaw
    loose(1, LOOSE_OUT);
    assert_int_equal(steps(40).goals_met, 0); // for less than hold_s
    assert_int_equal(steps(20).goals_met, 3);
    assert_true(attempt.end == ATTEMPT_DONE);
}

static void goals_without_order_come_as_they_come(void **state) {
    (void)state;
    begin("[goal a]\nvalgus_deg = 4\nhold_s = 0.1\n[goal b]\ndrawer_mm = 5\nhold_s = 0.1\n");
    bend(20, 0, 6);
    assert_int_equal(steps(50).goals_met, 0);
    task.in_order = false;
    attempt_init(&attempt);
    assert_int_equal(steps(50).goals_met, 2);
    bend(20, 5, 0);
    assert_int_equal(steps(50).goals_met, 1);
    assert_int_equal(attempt.end, ATTEMPT_DONE);
}

// Towards the patella, and the picture lies on its side.
static pose looking_aslant(vec3 from) {
    pose T = looking(from, landmark("patella"));
    quat roll = quat_from_axis_angle((vec3){0, 0, 1}, 90 * RAD_PER_DEG);
    T.rotation = quat_multiply(T.rotation, roll);
    return T;
}

#define TURN_THERE                                                                                 \
    "[goal a]\nsee = patella\nupright_deg = 20\nhold_s = 0.1\n"                                    \
    "[goal b]\nsee = patella\nstay_mm = 3\nhold_s = 0.1\n"

static void a_view_comes_by_turning_the_optic(void **state) {
    (void)state;
    begin(TURN_THERE);
    vec3 p = landmark("patella"), from = vec3_add_scaled(p, 30, forward);
    place(SCOPE, looking(from, p));
    assert_int_equal(steps(11).goals_met, 1);
    place(SCOPE, looking_aslant(vec3_add(from, (vec3){3.1, 0, 0})));
    assert_int_equal(steps(50).goals_met, 0); // the tip has moved
    place(SCOPE, looking_aslant(vec3_add(from, (vec3){2.9, 0, 0})));
    assert_int_equal(steps(50).goals_met, 2);
}

static void who_looks_again_from_elsewhere_may_turn_there(void **state) {
    (void)state;
    begin(TURN_THERE);
    vec3 p = landmark("patella"), near = vec3_add_scaled(p, 30, forward);
    place(SCOPE, looking(vec3_add_scaled(p, 40, forward), p));
    assert_int_equal(steps(11).goals_met, 1); // on the way
    place(SCOPE, looking_aslant(near));
    assert_int_equal(steps(50).goals_met, 0);
    place(SCOPE, looking(near, p));
    assert_int_equal(steps(9).goals_met, 0); // not long enough yet
    place(SCOPE, looking_aslant(near));
    assert_int_equal(steps(50).goals_met, 0);
    place(SCOPE, looking(near, p));
    steps(12);
    place(SCOPE, looking_aslant(near));
    steps(12);
    assert_int_equal(attempt.goals_met, 2);
}

// A shaft that runs from the portal to the point.
static pose through(const char *portal, vec3 to) {
    const struct knee_case *knee = scene_case(scene);
    for (int i = 0; i < knee->portal_count; i++)
        if (!strcmp(knee->portals[i].name, portal)) {
            pose T = looking(knee->portals[i].position, to);
            T.translation = to;
            return T;
        }
    fail_msg("no portal %s", portal);
    return pose_identity();
}

static void hands_are_told_by_their_portals(void **state) {
    (void)state;
    begin("[goal a]\ntouch = plateau_medial\nsee = plateau_medial\nwithin_mm = 100\n"
          "scope_portal = anteromedial\ntool_portal = anterolateral\nhold_s = 0.1\n");
    vec3 at = landmark("plateau_medial"), near = vec3_add(at, (vec3){0, 4, 14});
    output.T_mockup_virtual[BODY_FEMUR].translation.z = 200; // nothing hides it
    static const char *const portals[] = {"anterolateral", "anteromedial"};
    for (int scope = 0; scope < 2; scope++)
        for (int probe = 0; probe < 2; probe++) {
            pose seen = looking(near, at);
            touch(PROBE, "tibia", at, 0, 0);
            output.instruments[PROBE].T_mockup_tip = through(portals[probe], at);
            place(SCOPE, seen);
            output.instruments[SCOPE].T_mockup_tip = through(portals[scope], near);
            attempt_init(&attempt);
            assert_int_equal(steps(20).goals_met, scope == 1 && probe == 0);
        }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_landmark_is_seen),
        cmocka_unit_test(what_a_bone_hides_is_not_seen),
        cmocka_unit_test(tissue_that_was_cut_hides_nothing),
        cmocka_unit_test(a_picture_has_to_be_upright),
        cmocka_unit_test(a_scope_has_to_be_still),
        cmocka_unit_test(a_landmark_is_touched_in_view),
        cmocka_unit_test(a_line_is_followed_from_end_to_end),
        cmocka_unit_test(a_joint_is_held),
        cmocka_unit_test(a_resection_is_to_plan),
        cmocka_unit_test(a_loose_body_is_taken_out),
        cmocka_unit_test(goals_without_order_come_as_they_come),
        cmocka_unit_test(a_view_comes_by_turning_the_optic),
        cmocka_unit_test(who_looks_again_from_elsewhere_may_turn_there),
        cmocka_unit_test(hands_are_told_by_their_portals),
    };
    return cmocka_run_group_tests_name("attempt_goals", tests, make_case, drop_case);
}
