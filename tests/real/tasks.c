// Which of the shipped tasks an expert's hands pass on scanned knees. The cases are made by the
// tests knee_a and knee_b.
#include "folder.h"
#include "generate/pathology.h"
#include "landmarks/landmarks.h"
#include "rehearsal/rehearsal.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

// Knee A has many vertices, which makes it slow: some of the tasks that pass there.
static const char *const on_knee_a[] = {"cruciate-examination", "telescoping", NULL};
static const char *const on_knee_b[] = {"steady-camera",        "centring",
                                        "turning-30",           "turning-70",
                                        "telescoping",          "probe-in-order",
                                        "line-tracing",         "triangulation",
                                        "hands-swapped",        "palpation",
                                        "valgus-stress",        "diagnostic-examination",
                                        "cruciate-examination", NULL};
static const struct {
    const char *task;
    struct tear tear;
} resections_on_knee_b[] = {{"meniscectomy-radial", {TEAR_RADIAL, 0.6, 3.5, 0}},
                            {"meniscectomy-flap", {TEAR_FLAP, 0.6, 3.5, 10}},
                            {"meniscectomy-bucket-handle", {TEAR_BUCKET_HANDLE, 0.6, 3.5, 14}},
                            {"meniscectomy-horizontal", {TEAR_HORIZONTAL, 0.6, 3.5, 10}}};

static struct error err;
static char dir[FOLDER_MAX];
static struct knee_case *knee; // for hands: the scene has another one
static struct scene *scene;

static void propose(struct knee_case *made) {
    struct joint_fit joint;
    struct path_fit path;
    double clear[2];
    assert_ok(landmarks_fit_joint(made, &joint, &err));
    made->joint.T_femur_joint = made->joint.T_tibia_joint = joint.T_femur_joint;
    assert_ok(landmarks_fit_rest(made, &path, &err));
    assert_ok(landmarks_fit_patella(made, &path, &err));
    assert_ok(landmarks_find(made, NULL, &err));
    assert_ok(landmarks_find_portals(made, clear, &err));
}

// proposes: joint, landmarks and portals, in place of the import's. step: of the knee's pathology;
// NULL: it is healthy.
static void load(const char *name, bool proposes, const struct pathology *step) {
    char path[512];
    struct knee_case *made, *other;
    snprintf(path, sizeof path, CASES "/%s", name);
    assert_ok(case_load(path, NULL, &made, &err));
    if (proposes)
        propose(made);
    if (step)
        assert_ok(pathology_apply(made, step, 3.5, &err));
    assert_ok(case_save(made, dir, &err));
    case_destroy(&made);
    assert_ok(case_load(dir, NULL, &knee, &err));
    assert_ok(case_load(dir, NULL, &other, &err));
    assert_ok(scene_create(&other, &scene, &err));
}

static void drop(void) {
    scene_destroy(&scene);
    case_destroy(&knee);
}

// Whether an expert passes; how it went is printed.
static bool passes(const char *name) {
    char path[512];
    struct task task;
    struct rehearsal expert;
    snprintf(path, sizeof path, TASKS "/%s.ini", name);
    assert_ok(task_load(path, &task, &err));
    assert_ok(rehearse(&task, knee, scene, HANDS_EXPERT, 0, NULL, &expert, &err));
    bool passed = attempt_verdict(&expert.attempt, &task) == VERDICT_PASSED;
    printf("%s on %s: %s after %.1f s, %d errors %s\n", name, knee->name,
           passed ? "passed" : "not yet", attempt_time_s(&expert.attempt), expert.attempt.errors,
           expert.goal < 0 ? "" : err.text);
    rehearsal_fini(&expert);
    return passed;
}

static void all_pass(const char *name, const char *const *tasks) {
    int failed = 0;
    load(name, true, NULL);
    for (; *tasks; tasks++)
        failed += !passes(*tasks);
    drop();
    assert_int_equal(failed, 0);
}

static void an_expert_passes_on_knee_a(void **state) {
    (void)state;
    all_pass("knee_a", on_knee_a);
}

static void an_expert_passes_on_knee_b(void **state) {
    (void)state;
    all_pass("knee_b", on_knee_b);
}

static void an_expert_resects_on_knee_b(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof resections_on_knee_b / sizeof *resections_on_knee_b; i++) {
        const struct tear *tear = &resections_on_knee_b[i].tear;
        load("knee_b", true,
             &(struct pathology){.kind = PATHOLOGY_TEAR, .tear = {"meniscus_medial", *tear}});
        assert_true(passes(resections_on_knee_b[i].task));
        drop();
    }
}

// Through the portals of the import, the first way to the third one hides the grasper too long.
static void an_expert_takes_loose_bodies_out_of_knee_b(void **state) {
    (void)state;
    struct pathology step;
    pathology_init(&step, PATHOLOGY_LOOSE, "loose");
    assert_ok(pathology_take(&step, "count", "3", &err));
    load("knee_b", false, &step);
    assert_true(passes("loose-bodies"));
    drop();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_expert_passes_on_knee_b),
        cmocka_unit_test(an_expert_resects_on_knee_b),
        cmocka_unit_test(an_expert_takes_loose_bodies_out_of_knee_b),
        cmocka_unit_test(an_expert_passes_on_knee_a),
    };
    if (access(CASES "/knee_a/case.json", R_OK) || access(CASES "/knee_b/case.json", R_OK)) {
        puts("skipped: the cases knee_a and knee_b are not there");
        return 77;
    }
    folder_make(dir);
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    folder_remove(dir);
    return failed;
}
