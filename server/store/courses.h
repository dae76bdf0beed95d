// What a course asks of its trainees, and what passes: curricula and pass marks, in the records
// (store.h). Both have versions, which never change once they are in force.
#pragma once

#include "store/attempts.h"

// ---- curricula ----------------------------------------------------------------------------------

#define CURRICULUM_TASKS_MAX 64
#define CURRICULUM_CASES_MAX 16
#define CURRICULUM_AFTER_MAX 8
#define CURRICULUM_WEEK_MAX 104
#define CURRICULUM_PASSES_MAX 10

struct curriculum_task {
    char task[ATTEMPT_TASK_MAX];
    int week;           // from 1
    int passes;         // in a row, from 1
    bool each_hand;     // so many with either hand at the arthroscope
    int64_t due_utc_ns; // 0: never
    int case_count;     // 0: any case
    char cases[CURRICULUM_CASES_MAX][STORE_NAME_MAX];
    int after_count; // tasks of the same curriculum that have to be passed before
    char after[CURRICULUM_AFTER_MAX][ATTEMPT_TASK_MAX];
};

enum curriculum_state { CURRICULUM_DRAFT, CURRICULUM_PUBLISHED, CURRICULUM_FROZEN };
const char *curriculum_state_name(enum curriculum_state state); // "draft", "published", "frozen"

struct curriculum {
    int version; // from 1; 0: there is none
    enum curriculum_state state;
    int64_t changed_utc_ns;
    int count;
    struct curriculum_task tasks[CURRICULUM_TASKS_MAX];
};

// The newest version of a course: the draft, or (in_force) the newest that was published. Version 0
// if there is none. RESULT_MISSING: there is no such course.
enum result store_read_curriculum(struct store *store, const char *course, bool in_force,
                                  struct curriculum *out, struct error *err);

// Writes the tasks as the draft; as a new version if the newest one was published. publish: and
// puts it in force. version: the newest version that the caller knows, RESULT_REFUSED if there is a
// newer one, or the course is frozen. RESULT_INVALID names what is wrong with the tasks.
enum result store_write_curriculum(struct store *store, const char *course, int version,
                                   const struct curriculum_task *tasks, int count, bool publish,
                                   struct error *err);
// From now on nothing changes it, and a draft is gone. RESULT_REFUSED if none was published.
enum result store_freeze_curriculum(struct store *store, const char *course, int version,
                                    struct error *err);

// Attempts of a course's trainees, or of one of them (NULL: of all): trainee, task, case, hand,
// verdict, time_s, begun_utc_ns; those of a trainee after each other, oldest first. Only practice
// that counts (attempts.h).
enum result store_practice_in(struct store *store, const char *course, const char *trainee,
                              store_row_handler take, void *user, struct error *err);

// The times of the first, second, ... attempts at a task of the trainees of a course (NULL: of all)
// that met all goals, as store_figures_on gives figures: metric "time", subject the task, version
// the number of the attempt, from 1.
enum result store_times_at(struct store *store, const char *task, const char *course,
                           const char *hand, bool hide_few, store_row_handler take, void *user,
                           struct error *err);

// ---- pass marks ---------------------------------------------------------------------------------

#define MARK_TIME_MAX_S 3600 // as a task file and a trace have it
#define MARK_ERRORS_MAX 1000

struct pass_mark {
    int version;      // from 1; 0: the task file's
    int task_version; // of the task for which it was set
    char kind[24];    // "by hand", "contrasting groups", "published"
    char source[STORE_TEXT_MAX];
    double time_s;
    int errors;
    int64_t created_utc_ns;
};

// The mark in force for this version of the task. RESULT_MISSING: the records have none, the task
// file's counts.
enum result store_task_mark(struct store *store, const char *task, int task_version,
                            struct pass_mark *out, struct error *err);

// Puts a new version in force. mark->version: the one in force that the caller knows, 0 for none;
// RESULT_REFUSED if another one is. RESULT_INVALID names what is wrong.
enum result store_add_mark(struct store *store, const char *task, const struct pass_mark *mark,
                           struct error *err);
