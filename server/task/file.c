#include "task/file_keys.h"
#include "task/task.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

// ---- words --------------------------------------------------------------------------------------

// Names separated by blanks, into rows of CASE_NAME_MAX; 0: one is none, or there are too many.
static int take_names(const char *value, char (*out)[CASE_NAME_MAX], int most) {
    char text[TASK_TEXT_MAX], *rest;
    if (snprintf(text, sizeof text, "%s", value) >= (int)sizeof text)
        return 0;
    int count = 0;
    for (char *word = strtok_r(text, " \t", &rest); word; word = strtok_r(NULL, " \t", &rest)) {
        if (count == most || !case_name_is_valid(word))
            return 0;
        snprintf(out[count++], CASE_NAME_MAX, "%s", word);
    }
    return count;
}

static bool take_line(void *target, const char *rest, const char *value) {
    (void)rest;
    struct goal *goal = target;
    goal->place_count = take_names(value, goal->follow, TASK_PLACES_MAX);
    return goal->place_count >= 2;
}

static bool take_groups(void *target, const char *rest, const char *value) {
    (void)rest;
    struct task_error *error = target;
    error->group_count = take_names(value, error->groups, TASK_GROUPS_MAX);
    return error->group_count > 0;
}

static bool take_flexion(void *target, const char *rest, const char *value) {
    (void)rest;
    struct goal *goal = target;
    char end;
    return sscanf(value, "%lf %lf %c", &goal->flexion_from_deg, &goal->flexion_to_deg, &end) == 2 &&
           goal->flexion_from_deg >= -20 && goal->flexion_to_deg <= 160 &&
           goal->flexion_from_deg < goal->flexion_to_deg;
}

// ---- keys ---------------------------------------------------------------------------------------

#define IN_TASK(member) SETTING_IN(struct task, member)
#define IN_GOAL(member) SETTING_IN(struct goal, member)
#define IN_ERROR(member) SETTING_IN(struct task_error, member)

static const struct setting_key task_keys[] = {
    {"title", SETTING_TEXT, IN_TASK(title)},
    {"briefing", SETTING_TEXT, IN_TASK(briefing)},
    {"version", SETTING_INTEGER, IN_TASK(version), 1, 9999},
    {"in_order", SETTING_SWITCH, IN_TASK(in_order)},
    {"limit_s", SETTING_NUMBER, IN_TASK(limit_s), 5, 3600},
    {"optic_deg", SETTING_NUMBER, IN_TASK(optic_deg), 0, 90},
    {0}};

static const struct setting_key pass_keys[] = {
    {"time_s", SETTING_NUMBER, IN_TASK(pass_time_s), 1, 3600},
    {"errors", SETTING_INTEGER, IN_TASK(pass_errors), 0, 1000},
    {"source", SETTING_TEXT, IN_TASK(source)},
    {0}};

static const struct setting_key goal_keys[] = {
    {"hold_s", SETTING_NUMBER, IN_GOAL(hold_s), 0, 60},
    {"see", SETTING_TEXT, IN_GOAL(see)},
    {"centre", SETTING_NUMBER, IN_GOAL(centre), 0.05, 1},
    {"within_mm", SETTING_NUMBER, IN_GOAL(within_mm), 3, 100},
    {"beyond_mm", SETTING_NUMBER, IN_GOAL(beyond_mm), 0, 50},
    {"upright_deg", SETTING_NUMBER, IN_GOAL(upright_deg), 3, 90},
    {"still_mm", SETTING_NUMBER, IN_GOAL(still_mm), 0.5, 20},
    {"stay_mm", SETTING_NUMBER, IN_GOAL(stay_mm), 0.5, 20},
    {"scope_portal", SETTING_TEXT, IN_GOAL(scope_portal)},
    {"tool_portal", SETTING_TEXT, IN_GOAL(tool_portal)},
    {"touch", SETTING_TEXT, IN_GOAL(touch)},
    {"follow", .take = take_line, .wanted = "2 to 8 landmarks"},
    {"tool", SETTING_TEXT, IN_GOAL(tool)},
    {"reach_mm", SETTING_NUMBER, IN_GOAL(reach_mm), 0.5, 30},
    {"in_view", SETTING_SWITCH, IN_GOAL(in_view)},
    {"valgus_deg", SETTING_NUMBER, IN_GOAL(valgus_deg), 0.5, 30},
    {"varus_deg", SETTING_NUMBER, IN_GOAL(varus_deg), 0.5, 30},
    {"drawer_mm", SETTING_NUMBER, IN_GOAL(drawer_mm), 0.5, 30},
    {"flexion_deg", .take = take_flexion, .wanted = "two angles from -20 to 160, the lower first"},
    {"resect", SETTING_TEXT, IN_GOAL(resect)},
    {"under_share", SETTING_NUMBER, IN_GOAL(under_share), 0, 1},
    {"over_share", SETTING_NUMBER, IN_GOAL(over_share), 0, 10},
    {"rim_mm", SETTING_NUMBER, IN_GOAL(rim_mm), 0, 15},
    {"step_mm", SETTING_NUMBER, IN_GOAL(step_mm), 0, 15},
    {"take_out", SETTING_TEXT, IN_GOAL(take_out)},
    {0}};

static const struct setting_key error_keys[] = {
    {"for_s", SETTING_NUMBER, IN_ERROR(for_s), 0, 60},
    {"sentinel", SETTING_SWITCH, IN_ERROR(sentinel)},
    {"tool", SETTING_TEXT, IN_ERROR(tool)},
    {"groups", .take = take_groups, .wanted = "up to 8 groups"},
    {"deep_mm", SETTING_NUMBER, IN_ERROR(deep_mm), 0.1, 20},
    {"running", SETTING_SWITCH, IN_ERROR(running)},
    {"near_mm", SETTING_NUMBER, IN_ERROR(near_mm), 0.1, 30},
    {"speed_mm_s", SETTING_NUMBER, IN_ERROR(speed_mm_s), 1, 1000},
    {"unseen", SETTING_SWITCH, IN_ERROR(unseen)},
    {"dropped", SETTING_SWITCH, IN_ERROR(dropped)},
    {"over_share", SETTING_NUMBER, IN_ERROR(over_share), 0, 10},
    {0}};

const struct setting_key *task_goal_keys(void) {
    return goal_keys;
}

const struct setting_key *task_error_keys(void) {
    return error_keys;
}

// ---- sections -----------------------------------------------------------------------------------

static void *the_task(void *user, const char *name, struct error *err) {
    (void)name;
    (void)err;
    return user;
}

static bool name_is_good(const char *kind, const char *name, struct error *err) {
    if (case_name_is_valid(name) && strlen(name) < TASK_NAME_MAX)
        return true;
    fail(err, RESULT_INVALID, "'%s' is no name of a%s: 1 to %d letters, digits, '.', '-' and '_'",
         name, kind, TASK_NAME_MAX - 1);
    return false;
}

static void *goal_named(void *user, const char *name, struct error *err) {
    struct task *task = user;
    for (int i = 0; i < task->goal_count; i++)
        if (!strcmp(task->goals[i].name, name))
            return &task->goals[i];
    if (!name_is_good(" goal", name, err))
        return NULL;
    if (task->goal_count == TASK_GOALS_MAX) {
        fail(err, RESULT_LIMIT, "a task has at most %d goals", TASK_GOALS_MAX);
        return NULL;
    }
    struct goal *goal = &task->goals[task->goal_count++];
    *goal = (struct goal){.hold_s = 0.5,
                          .centre = 1,
                          .within_mm = 40,
                          .upright_deg = NAN,
                          .still_mm = NAN,
                          .stay_mm = NAN,
                          .tool = "probe",
                          .reach_mm = 3,
                          .valgus_deg = NAN,
                          .varus_deg = NAN,
                          .drawer_mm = NAN,
                          .flexion_from_deg = NAN,
                          .flexion_to_deg = NAN,
                          .under_share = NAN,
                          .over_share = NAN,
                          .rim_mm = NAN,
                          .step_mm = NAN};
    snprintf(goal->name, sizeof goal->name, "%s", name);
    return goal;
}

static void *error_named(void *user, const char *name, struct error *err) {
    struct task *task = user;
    for (int i = 0; i < task->error_count; i++)
        if (!strcmp(task->errors[i].name, name))
            return &task->errors[i];
    if (!name_is_good("n error", name, err))
        return NULL;
    if (task->error_count == TASK_ERRORS_MAX) {
        fail(err, RESULT_LIMIT, "a task has at most %d kinds of errors", TASK_ERRORS_MAX);
        return NULL;
    }
    struct task_error *error = &task->errors[task->error_count++];
    *error = (struct task_error){
        .for_s = 0.2, .deep_mm = NAN, .near_mm = NAN, .speed_mm_s = NAN, .over_share = NAN};
    snprintf(error->name, sizeof error->name, "%s", name);
    return error;
}

static const struct setting_section sections[] = {{"task", task_keys, the_task},
                                                  {"pass", pass_keys, the_task},
                                                  {"goal NAME", goal_keys, goal_named},
                                                  {"error NAME", error_keys, error_named},
                                                  {0}};

// ---- the whole ----------------------------------------------------------------------------------

static bool holds_joint(const struct goal *goal) {
    return !isnan(goal->valgus_deg) || !isnan(goal->varus_deg) || !isnan(goal->drawer_mm) ||
           !isnan(goal->flexion_from_deg);
}

static bool judges_resection(const struct goal *goal) {
    return !isnan(goal->under_share) || !isnan(goal->over_share) || !isnan(goal->rim_mm) ||
           !isnan(goal->step_mm);
}

static enum result check_goal(const struct goal *goal, struct error *err) {
    const char *name = goal->name;
    if (goal->touch[0] && goal->place_count)
        return fail(err, RESULT_INVALID, "[goal %s]: touch and follow exclude each other", name);
    if (!goal->see[0] && (!isnan(goal->upright_deg) || !isnan(goal->still_mm)))
        return fail(err, RESULT_MISSING, "[goal %s]: upright_deg and still_mm need see", name);
    if (!goal->see[0] && !goal->in_view && goal->scope_portal[0])
        return fail(err, RESULT_MISSING, "[goal %s]: scope_portal needs see or in_view", name);
    if (goal->tool_portal[0] && !goal->touch[0] && !goal->place_count)
        return fail(err, RESULT_MISSING, "[goal %s]: tool_portal needs touch or follow", name);
    if (goal->beyond_mm >= goal->within_mm)
        return fail(err, RESULT_INVALID, "[goal %s]: beyond_mm must be less than within_mm", name);
    if (judges_resection(goal) != (goal->resect[0] != '\0'))
        return fail(
            err, RESULT_MISSING,
            "[goal %s]: resect needs under_share, over_share, rim_mm or step_mm, and they it",
            name);
    if (goal->see[0] || goal->touch[0] || goal->place_count || goal->resect[0] ||
        goal->take_out[0] || holds_joint(goal))
        return RESULT_OK;
    return fail(err, RESULT_MISSING, "[goal %s] has no condition", name);
}

// Where the tip stood is known from the goal before.
static enum result check_stay(const struct task *task, int index, struct error *err) {
    const struct goal *goal = &task->goals[index];
    if (isnan(goal->stay_mm) ||
        (task->in_order && index > 0 && goal->see[0] && task->goals[index - 1].see[0]))
        return RESULT_OK;
    return fail(err, RESULT_MISSING,
                "[goal %s]: stay_mm needs see, here and in the goal before, and goals in order",
                goal->name);
}

static enum result check_error(const struct task_error *error, struct error *err) {
    bool is_near = error->running || !isnan(error->speed_mm_s);
    if (is_near != !isnan(error->near_mm))
        return fail(err, RESULT_MISSING,
                    "[error %s]: running and speed_mm_s need near_mm, and it them", error->name);
    bool is_of_tool =
        is_near || !isnan(error->deep_mm) || error->unseen || error->tool[0] || error->group_count;
    bool is_cut = !isnan(error->over_share);
    if ((is_cut || error->dropped) && (is_of_tool || (is_cut && error->dropped)))
        return fail(err, RESULT_INVALID, "[error %s]: over_share and dropped stand alone",
                    error->name);
    if (is_near || !isnan(error->deep_mm) || is_cut || error->unseen || error->dropped)
        return RESULT_OK;
    return fail(err, RESULT_MISSING, "[error %s] has no condition", error->name);
}

static enum result check_task(const struct task *task, struct error *err) {
    enum result result = RESULT_OK;
    if (!task->title[0])
        return fail(err, RESULT_MISSING, "[task] title is missing");
    if (!task->briefing[0])
        return fail(err, RESULT_MISSING, "[task] briefing is missing");
    if (isnan(task->pass_time_s) || !task->source[0])
        return fail(err, RESULT_MISSING, "[pass] needs time_s and source");
    if (task->pass_time_s > task->limit_s)
        return fail(err, RESULT_INVALID, "[pass] time_s is beyond [task] limit_s");
    if (task->goal_count == 0)
        return fail(err, RESULT_MISSING, "there is no [goal NAME]");
    for (int i = 0; i < task->goal_count && result == RESULT_OK; i++)
        result = check_goal(&task->goals[i], err);
    for (int i = 0; i < task->goal_count && result == RESULT_OK; i++)
        result = check_stay(task, i, err);
    for (int i = 0; i < task->error_count && result == RESULT_OK; i++)
        result = check_error(&task->errors[i], err);
    return result;
}

static enum result name_after(struct task *task, const char *path, struct error *err) {
    const char *slash = strrchr(path, '/'), *file = slash ? slash + 1 : path;
    size_t length = strlen(file);
    if (length > 4 && !strcmp(file + length - 4, ".ini"))
        length -= 4;
    if (length >= sizeof task->name)
        return fail(err, RESULT_LIMIT, "the name of a task has at most %d bytes",
                    TASK_NAME_MAX - 1);
    memcpy(task->name, file, length);
    return case_name_is_valid(task->name)
               ? RESULT_OK
               : fail(err, RESULT_INVALID,
                      "'%s' is no name of a task: 1 to %d letters, digits, '.', '-' and '_'",
                      task->name, TASK_NAME_MAX - 1);
}

enum result task_parse(const char *path, const char *text, size_t size, struct task *out_task,
                       struct error *err) {
    *out_task = (struct task){
        .version = 1, .in_order = true, .limit_s = 600, .optic_deg = NAN, .pass_time_s = NAN};
    if (size == 0 || size > TASK_FILE_MAX)
        return fail(err, size ? RESULT_LIMIT : RESULT_MISSING,
                    "%s has %zu bytes; a task has 1 to %d", path, size, TASK_FILE_MAX);
    enum result result = settings_load_text(path, text, size, sections, out_task, err);
    if (result != RESULT_OK)
        return result;
    result = name_after(out_task, path, err);
    if (result == RESULT_OK)
        result = check_task(out_task, err);
    return result == RESULT_OK ? RESULT_OK : fail_in(err, result, "%s: ", path);
}

enum result task_read(const char *path, struct task_file *out, struct error *err) {
    char text[TASK_FILE_MAX + 1];
    FILE *file = fopen(path, "re");
    memset(out, 0, sizeof *out);
    out->size = file ? fread(text, 1, sizeof text, file) : 0;
    bool failed = !file || ferror(file);
    int why = errno;
    if (file)
        fclose(file);
    if (failed)
        return fail(err, RESULT_MISSING, "%s cannot be read: %s", path, strerror(why));
    enum result result = task_parse(path, text, out->size, &out->task, err);
    if (result == RESULT_OK)
        memcpy(out->text, text, out->size);
    return result;
}

enum result task_load(const char *path, struct task *out_task, struct error *err) {
    struct task_file file;
    enum result result = task_read(path, &file, err);
    *out_task = file.task;
    return result;
}
