// The shipped motions on scanned knees with a torn meniscus. The cases are made by the tests knee_a
// and knee_b.
#include "generate/pathology.h"
#include "landmarks/landmarks.h"
#include "mesh/topology.h"
#include "motion/motion.h"
#include "test.h"
#include "winding.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static struct knee_case *prepared(const char *name) {
    char dir[512];
    struct knee_case *knee;
    struct error err;
    struct joint_fit joint;
    struct path_fit path;
    double clear[2];
    struct pathology tear = {.kind = PATHOLOGY_TEAR,
                             .tear = {"meniscus_medial", {TEAR_RADIAL, 0.6, 4, 0}}};
    snprintf(dir, sizeof dir, CASES "/%s", name);
    if (case_load(dir, NULL, &knee, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_ok(landmarks_fit_joint(knee, &joint, &err));
    knee->joint.T_femur_joint = knee->joint.T_tibia_joint = joint.T_femur_joint;
    assert_ok(landmarks_fit_rest(knee, &path, &err));
    assert_ok(landmarks_fit_patella(knee, &path, &err));
    assert_ok(landmarks_find(knee, NULL, &err));
    assert_ok(landmarks_find_portals(knee, clear, &err));
    assert_ok(pathology_apply(knee, &tear, 3.5, &err));
    return knee;
}

struct seen {
    int touches, bites, shaving_rows;
};

static struct seen seen_in(const struct motion *motion) {
    struct seen seen = {0};
    for (size_t r = 1; r < motion->row_count; r++) {
        const struct motion_row *row = &motion->rows[r];
        seen.touches += row->touch && !row[-1].touch;
        for (int i = 0; i < motion->tool_count; i++) {
            bool open = row->tools[i].opening > 0.5, was_open = row[-1].tools[i].opening > 0.5;
            seen.bites += motion->tools[i].channel == CHANNEL_PUNCH && open && !was_open;
            seen.shaving_rows += motion->tools[i].channel == CHANNEL_SHAVER && open;
        }
    }
    return seen;
}

// Open sheets have no inside that a solid angle tells: knee B's femur is left out.
static void check_shafts(struct knee_case *knee, const struct motion *motion) {
    for (size_t r = 0; r < motion->row_count; r += 701)
        for (int i = 0; i < motion->tool_count; i++)
            for (int body = 0; body < BODY_COUNT; body++) {
                const struct case_group *bone = case_group(knee, body_name((enum body)body));
                const struct motion_row *row = &motion->rows[r];
                vec3 tip = row->tools[i].T_mockup_tip.translation;
                pose T = body == BODY_TIBIA     ? joint_to_pose(&knee->joint, &row->joint)
                         : body == BODY_PATELLA ? case_patella_pose(knee, row->joint.flexion_deg)
                                                : pose_identity();
                if (!topology_of(&bone->mesh).closed)
                    continue;
                for (double share = 0; share < 0.95; share += 0.3) {
                    vec3 p = vec3_lerp(motion->tools[i].portal, tip, share);
                    if (is_inside(&bone->mesh, pose_apply_inverse(T, p)))
                        fail_msg("%.2f s: inside the %s", row->t_seconds, bone->name);
                }
            }
}

static struct seen play(struct knee_case *knee, const char *script_name, int most_skipped) {
    char path[512];
    struct motion_script script;
    struct motion motion;
    struct error err;
    snprintf(path, sizeof path, MOTIONS "/%s.ini", script_name);
    assert_ok(motion_script_load(path, &script, &err));
    script.tremor_mm = 0;
    script.rate_hz = 40; // quicker
    if (motion_plan(knee, &script, &motion, &err) != RESULT_OK)
        fail_msg("%s on %s: %s", script_name, knee->name, err.text);
    if (motion.skipped_count > most_skipped)
        fail_msg("%s on %s: %s", script_name, knee->name, motion.skipped[most_skipped].text);
    check_shafts(knee, &motion);
    struct seen seen = seen_in(&motion);
    motion_fini(&motion);
    return seen;
}

static void the_motions_play_on(const char *name, bool with_stress) {
    struct knee_case *knee = prepared(name);
    struct seen tour = play(knee, "tour", 0), lesson = play(knee, "lesson", 0);
    assert_int_equal(tour.touches, 6);
    assert_int_equal(lesson.touches, 2);
    assert_true(lesson.bites >= 4 && lesson.shaving_rows > 0);
    struct seen resection = play(knee, "resection", 0);
    assert_true(resection.bites >= 4 && resection.shaving_rows > 0);
    if (with_stress) // the knee has no cruciate ligament to touch, but twice a bone
        assert_int_equal(play(knee, "stress", 2).touches, 2);
    case_destroy(&knee);
}

static void a_tour_and_an_operation_play_on_knee_a(void **state) {
    (void)state;
    the_motions_play_on("knee_a", false); // its many vertices make the stress slow
}

static void all_motions_play_on_knee_b(void **state) {
    (void)state;
    the_motions_play_on("knee_b", true);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tour_and_an_operation_play_on_knee_a),
        cmocka_unit_test(all_motions_play_on_knee_b),
    };
    if (access(CASES "/knee_a/case.json", R_OK) || access(CASES "/knee_b/case.json", R_OK)) {
        puts("skipped: the cases knee_a and knee_b are not there");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
