// Task files: what is wrong in one is named, and what is not said has its default.
#include "folder.h"
#include "task/task.h"
#include "test.h"

#include <dirent.h>
#include <stdio.h>
#include <string.h>

static char dir[FOLDER_MAX];
static struct task task;
static struct error err;

#define HEAD "[task]\ntitle = T\nbriefing = Do it.\n[pass]\ntime_s = 30\nsource = by hand\n"
#define WHOLE HEAD "[goal a]\nsee = notch\n"

static enum result load(const char *text) {
    char path[FOLDER_MAX + 16];
    snprintf(path, sizeof path, "%s/one.ini", dir);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
    return task_load(path, &task, &err);
}

static void what_is_not_said_has_its_default(void **state) {
    (void)state;
    assert_ok(load(WHOLE));
    assert_string_equal(task.name, "one");
    assert_int_equal(task.version, 1);
    assert_true(task.in_order);
    assert_near(task.limit_s, 600, 0);
    assert_int_equal(task.pass_errors, 0);
    assert_int_equal(task.goal_count, 1);
    assert_near(task.goals[0].hold_s, 0.5, 0);
    assert_string_equal(task.goals[0].tool, "probe");
    assert_true(isnan(task.goals[0].upright_deg));
    assert_int_equal(task.error_count, 0);
}

static void what_is_wrong_is_named(void **state) {
    (void)state;
    const struct {
        const char *text, *says;
    } rows[] = {
        {"[pass]\ntime_s = 3\nsource = x\n[goal a]\nsee = notch\n", "[task] title is missing"},
        {"[task]\ntitle = T\n[pass]\ntime_s = 3\nsource = x\n[goal a]\nsee = notch\n",
         "[task] briefing is missing"},
        {"[task]\ntitle = T\nbriefing = b\n[goal a]\nsee = notch\n",
         "[pass] needs time_s and source"},
        {HEAD, "there is no [goal NAME]"},
        {HEAD "[goal a]\nhold_s = 1\n", "[goal a] has no condition"},
        {HEAD "[goal a b]\nsee = notch\n", "'a b' is no name of a goal"},
        {HEAD "[goal a]\nsee = notch\nsea = notch\n", "sea"},
        {HEAD "[goal a]\nsee = notch\nhold_s = 61\n", "hold_s"},
        {HEAD "[goal a]\ntouch = notch\nfollow = notch trochlea\n",
         "[goal a]: touch and follow exclude each other"},
        {HEAD "[goal a]\nfollow = notch\n", "2 to 8 landmarks"},
        {HEAD "[goal a]\ntouch = notch\nstill_mm = 1\n", "upright_deg and still_mm need see"},
        {HEAD "[goal a]\nsee = notch\nwithin_mm = 10\nbeyond_mm = 10\n",
         "beyond_mm must be less than within_mm"},
        {HEAD "[goal a]\nsee = notch\nstay_mm = 3\n", "[goal a]: stay_mm needs see"},
        {HEAD "[goal a]\nvalgus_deg = 3\nscope_portal = anteromedial\n",
         "[goal a]: scope_portal needs see or in_view"},
        {HEAD "[goal a]\nsee = notch\ntool_portal = anteromedial\n",
         "[goal a]: tool_portal needs touch or follow"},
        {HEAD "[goal a]\nresect = meniscus_medial\n", "[goal a]: resect needs under_share"},
        {HEAD "[goal a]\nsee = notch\nover_share = 0.5\n", "[goal a]: resect needs under_share"},
        {HEAD "[goal a]\nsee = notch\nflexion_deg = 30 20\n", "two angles"},
        {WHOLE "[error e]\nfor_s = 1\n", "[error e] has no condition"},
        {WHOLE "[error e]\nrunning = yes\n", "[error e]: running and speed_mm_s need near_mm"},
        {WHOLE "[error e]\nnear_mm = 3\n", "need near_mm, and it them"},
        {WHOLE "[error e]\nover_share = 3\ntool = punch\n",
         "[error e]: over_share and dropped stand alone"},
        {WHOLE "[error e]\ndeep_mm = 1\ngroups = a b c d e f g h i\n", "up to 8 groups"},
        {"[task]\ntitle = T\nbriefing = b\nlimit_s = 20\n[pass]\ntime_s = 30\nsource = x\n"
         "[goal a]\nsee = notch\n",
         "[pass] time_s is beyond [task] limit_s"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (load(rows[i].text) == RESULT_OK)
            fail_msg("row %zu was taken", i);
        if (!strstr(err.text, rows[i].says) || !strstr(err.text, "one.ini"))
            fail_msg("row %zu says: %s", i, err.text);
    }
}

static void goals_and_errors_have_a_limit(void **state) {
    (void)state;
    char text[16384];
    int length = snprintf(text, sizeof text, "%s", HEAD);
    for (int i = 0; i <= TASK_GOALS_MAX; i++)
        length +=
            snprintf(text + length, sizeof text - (size_t)length, "[goal g%d]\nsee = notch\n", i);
    assert_int_equal(load(text), RESULT_INVALID);
    assert_non_null(strstr(err.text, "a task has at most 24 goals"));
    length = snprintf(text, sizeof text, "%s", WHOLE);
    for (int i = 0; i <= TASK_ERRORS_MAX; i++)
        length +=
            snprintf(text + length, sizeof text - (size_t)length, "[error e%d]\ndeep_mm = 1\n", i);
    assert_int_equal(load(text), RESULT_INVALID);
    assert_non_null(strstr(err.text, "a task has at most 12 kinds of errors"));
}

static void the_tasks_of_the_tree_are_good(void **state) {
    (void)state;
    DIR *folder = opendir(TASKS);
    int count = 0;
    assert_non_null(folder);
    for (struct dirent *entry; (entry = readdir(folder));) {
        char path[512];
        if (!strstr(entry->d_name, ".ini"))
            continue;
        snprintf(path, sizeof path, "%s/%s", TASKS, entry->d_name);
        assert_ok(task_load(path, &task, &err));
        count++;
    }
    closedir(folder);
    assert_true(count > 1);
}

static int make_folder(void **state) {
    (void)state;
    folder_make(dir);
    return 0;
}

static int remove_folder(void **state) {
    (void)state;
    folder_remove(dir);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_not_said_has_its_default),
        cmocka_unit_test(what_is_wrong_is_named),
        cmocka_unit_test(goals_and_errors_have_a_limit),
        cmocka_unit_test(the_tasks_of_the_tree_are_good),
    };
    return cmocka_run_group_tests_name("task_file", tests, make_folder, remove_folder);
}
