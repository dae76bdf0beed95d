// An attempt that lives through kills of its server is the same to the last byte, and its trace
// gives the same verdict.
#include "folder.h"
#include "generate/generate.h"
#include "landmarks/landmarks.h"
#include "lives/lives.h"
#include "rehearsal/rehearsal.h"
#include "test.h"

#include <stdio.h>

#define REHEARSAL_HZ 100

static char dir[FOLDER_MAX];
static struct error err;
static struct knee_case *knee; // for hands: the scene has another one
static struct scene *scene;

static struct lives live(const char *name, enum rehearsal_hands hands, int kills, int64_t seed) {
    struct task_file file;
    struct rehearsal rehearsal;
    struct lives lives;
    char path[FOLDER_MAX + 64];
    snprintf(path, sizeof path, "%s/%s.ini", TASKS, name);
    assert_ok(task_read(path, &file, &err));
    assert_ok(rehearse(&file.task, knee, scene, hands, seed, NULL, &rehearsal, &err));
    snprintf(path, sizeof path, "%s/%s-%d.trace", dir, name, (int)hands);
    assert_ok(lives_run(&file, scene, &rehearsal.motion, REHEARSAL_HZ, kills, (uint64_t)seed, path,
                        &lives, &err));
    printf("%s: %s after %d kills, %d with a state, in %llu steps, %d goals, %d errors\n", name,
           verdict_name(lives.verdict), lives.kills, lives.kept, (unsigned long long)lives.steps,
           lives.attempt.goals_met, lives.attempt.errors);
    rehearsal_fini(&rehearsal);
    return lives;
}

static void an_attempt_without_kills_is_the_one_of_its_trace(void **state) {
    (void)state;
    struct lives lives = live("telescoping", HANDS_EXPERT, 0, 1);
    assert_int_equal(lives.differences, 0);
    assert_int_equal(lives.verdict, VERDICT_PASSED);
    assert_int_equal(lives.traced_verdict, VERDICT_PASSED);
}

static void a_killed_attempt_goes_on_as_it_was(void **state) {
    (void)state;
    struct lives lives = live("line-tracing", HANDS_EXPERT, 3, 2);
    assert_true(lives.kills > 0 && lives.kept > 0);
    assert_int_equal(lives.differences, 0);
    assert_int_equal(lives.verdict, lives.traced_verdict);
}

static void errors_are_counted_once_over_kills(void **state) {
    (void)state;
    struct lives lives = live("line-tracing", HANDS_NOVICE, 1, 2);
    assert_true(lives.kills > 0);
    assert_int_equal(lives.differences, 0);
    assert_int_equal(lives.traced_verdict, VERDICT_NOT_YET);
}

static struct knee_case *make_knee(void) {
    struct recipe recipe;
    struct knee_case *made;
    assert_ok(recipe_load(CASES "/healthy", &recipe, &err));
    assert_ok(generate_knee(&recipe, &made, &err));
    assert_ok(landmarks_find(made, NULL, &err));
    return made;
}

static int make(void **state) {
    (void)state;
    struct knee_case *other = make_knee();
    folder_make(dir);
    knee = make_knee();
    assert_ok(scene_create(&other, &scene, &err));
    return 0;
}

static int drop(void **state) {
    (void)state;
    scene_destroy(&scene);
    case_destroy(&knee);
    folder_remove(dir);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_attempt_without_kills_is_the_one_of_its_trace),
        cmocka_unit_test(a_killed_attempt_goes_on_as_it_was),
        cmocka_unit_test(errors_are_counted_once_over_kills),
    };
    return cmocka_run_group_tests(tests, make, drop);
}
