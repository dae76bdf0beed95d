// Tasks are passed by an expert's hands on the case that they are about, and failed by a novice's.
#include "generate/generate.h"
#include "landmarks/landmarks.h"
#include "rehearsal/play.h"
#include "rehearsal/rehearsal.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

// One of each kind: arthron-bench tasks has them all.
static const struct {
    const char *task, *recipe;
} rows[] = {
    {"turning-30", "everything"},
    {"cruciate-examination", "everything"},
    {"loose-bodies", "loose-bodies"},
    {"meniscectomy-radial", "tear-radial"},
};
#define ROW_COUNT (sizeof rows / sizeof *rows)

static struct error err;
static struct knee_case *knee; // for hands: the scene has another one
static struct scene *scene;
static const char *loaded;

static struct knee_case *make_knee(const char *recipe_name) {
    char path[512];
    struct recipe recipe;
    struct knee_case *made;
    snprintf(path, sizeof path, CASES "/%s", recipe_name);
    assert_ok(recipe_load(path, &recipe, &err));
    assert_ok(generate_knee(&recipe, &made, &err));
    assert_ok(landmarks_find(made, NULL, &err));
    return made;
}

static void load(const char *recipe) {
    if (loaded && !strcmp(loaded, recipe))
        return;
    if (loaded)
        scene_destroy(&scene);
    case_destroy(&knee);
    struct knee_case *other = make_knee(recipe);
    knee = make_knee(recipe);
    assert_ok(scene_create(&other, &scene, &err));
    loaded = recipe;
}

static void tell(const struct task *task, const char *hands, const struct rehearsal *rehearsal) {
    printf("%-26s %-8s %-8s %6.1f s %d errors\n", task->name, hands,
           verdict_name(attempt_verdict(&rehearsal->attempt, task)),
           attempt_time_s(&rehearsal->attempt), rehearsal->attempt.errors);
}

// A tool that waits inside is out of the picture until the scope looks, which may be an error.
static void assert_looks_first(const struct motion_script *script) {
    bool looks = false;
    for (int i = 0; i < script->step_count; i++) {
        const struct motion_step *step = &script->steps[i];
        looks |= step->verb == MOTION_LOOK || step->verb == MOTION_STAND;
        if (step->verb == MOTION_APPROACH && step->tool != CHANNEL_SCOPE)
            assert_true(looks);
    }
}

static void check_grasp(void *user, const struct session_input *input,
                        const struct session_output *output) {
    int *grasps = user;
    (void)input;
    if (!(output->events & EVENT_GRASPED))
        return;
    for (int i = 0; i < output->loose_count; i++) {
        const struct loose_output *loose = &output->loose[i];
        if (loose->state != LOOSE_HELD)
            continue;
        const struct instrument_output *jaw = &output->instruments[loose->carrier - BODY_COUNT];
        vec3 off = vec3_sub(loose->T_mockup_loose.translation, jaw->T_mockup_warped.translation);
        assert_true(vec3_length(off) < 0.5);
        ++*grasps;
    }
}

// So that the noise of a tracker makes no jaw miss.
static void assert_grasps_the_middle(const struct task *task, const struct motion *motion) {
    struct view_optic optic = task_optic(task);
    struct site *site;
    struct attempt attempt;
    int grasps = 0;
    assert_ok(site_create(task, scene, instruments_of_hands(), &optic, &site, &err));
    play_motion(motion, 100, scene, site, &(struct play_watch){&grasps, check_grasp}, &attempt);
    assert_int_equal(grasps, knee->loose_count);
    site_destroy(&site);
}

static void check_task(size_t row) {
    char path[512];
    struct task task;
    struct rehearsal expert, novice;
    snprintf(path, sizeof path, CASES "/tasks/%s.ini", rows[row].task);
    assert_ok(task_load(path, &task, &err));
    load(rows[row].recipe);
    assert_ok(rehearse(&task, knee, scene, HANDS_EXPERT, 0, NULL, &expert, &err));
    tell(&task, "expert", &expert);
    if (attempt_verdict(&expert.attempt, &task) != VERDICT_PASSED)
        fail_msg("%s on %s: %s", task.name, rows[row].recipe, err.text);
    assert_looks_first(expert.script);
    if (knee->loose_count)
        assert_grasps_the_middle(&task, &expert.motion);
    assert_ok(rehearse_novice(&task, knee, scene, &expert, 1 + (int64_t)row % 3, &novice, &err));
    tell(&task, "novice", &novice);
    assert_int_equal(attempt_verdict(&novice.attempt, &task), VERDICT_NOT_YET);
    rehearsal_fini(&expert);
    rehearsal_fini(&novice);
}

static void experts_pass_and_novices_do_not(void **state) {
    (void)state;
    for (size_t i = 0; i < ROW_COUNT; i++)
        check_task(i);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(experts_pass_and_novices_do_not)};
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    scene_destroy(&scene);
    case_destroy(&knee);
    return failed;
}
