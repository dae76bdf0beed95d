// A task: what a trainee is asked to do, and what counts. A file (INI) that a course director
// writes; cases/README.md explains its keys.
//
// Lengths are millimetres, angles degrees, forces newton, times seconds. Places are landmarks of
// the case on which the task is done.
#pragma once

#include "base/result.h"
#include "base/sample.h"
#include "case/case.h"

#define TASK_GOALS_MAX 24
#define TASK_ERRORS_MAX 12
#define TASK_NAME_MAX 32
#define TASK_PLACES_MAX 8 // of a line
#define TASK_GROUPS_MAX 8
#define TASK_TEXT_MAX 512

// A goal is met once all its conditions have held together for hold_s. A condition that is not
// given (NAN, an empty name) always holds.
struct goal {
    char name[TASK_NAME_MAX];
    double hold_s;

    // The optic sees the landmark: not behind a surface, in the picture up to the share `centre` of
    // its radius, at a distance in [beyond_mm, within_mm], the tibia's axis upright in the picture
    // up to upright_deg, with the scope's tip held within still_mm from where it was at first.
    char see[CASE_NAME_MAX];
    double centre, within_mm, beyond_mm, upright_deg, still_mm;
    // Its tip is not farther than this from where it was when the goal before was met: the view has
    // come by turning the optic.
    double stay_mm;

    // Of the case's portals the shaft of the scope, or of `tool`, passes nearest to this one.
    char scope_portal[CASE_NAME_MAX], tool_portal[CASE_NAME_MAX];

    // The tip of `tool` touches the landmark's group, not more than reach_mm farther from the
    // landmark than the surface is, in the scope's picture where in_view.
    char touch[CASE_NAME_MAX];
    // Or it follows the line from landmark to landmark on that surface, from one end to the other,
    // within reach_mm of it.
    int place_count;
    char follow[TASK_PLACES_MAX][CASE_NAME_MAX];
    char tool[TASK_NAME_MAX];
    double reach_mm;
    bool in_view;

    // The joint is held so: at least so much, and flexed in a range.
    double valgus_deg, varus_deg, drawer_mm, flexion_from_deg, flexion_to_deg;

    // Of a group's resection (quality/quality.h): planned and still there, and removed beyond the
    // plan, both as shares of the plan, at most; the rim at least, its steps at most.
    char resect[CASE_NAME_MAX];
    double under_share, over_share, rim_mm, step_mm;

    char take_out[CASE_NAME_MAX]; // this loose body is out of the knee; "all": every one
};

// An error counts once for each time that all its conditions hold together for for_s. It ends when
// one of them has not held for ERROR_APART_NS.
struct task_error {
    char name[TASK_NAME_MAX];
    double for_s;
    bool sentinel;            // it ends the attempt, which has failed
    char tool[TASK_NAME_MAX]; // empty: any but an optic

    int group_count; // 0: any
    char groups[TASK_GROUPS_MAX][CASE_NAME_MAX];
    double deep_mm; // deeper in one of the groups
    bool running;   // a burr that turns, at most near_mm off one of the groups
    double near_mm;
    double speed_mm_s; // faster than so, at most near_mm off one of the groups
    bool unseen;       // inside the knee, and not in the scope's picture
    bool dropped;      // a jaw lost a loose body inside the knee; it goes with none of the others
    double over_share; // more of any group removed beyond its plan, as a share of the plan; it goes
                       // with none of the above
};

struct task {
    char name[TASK_NAME_MAX]; // of the file, without .ini
    char title[TASK_NAME_MAX * 2];
    char briefing[TASK_TEXT_MAX];
    int version;      // 1 or more; its author raises it when what it judges changes
    bool in_order;    // a goal counts only after the one before
    double limit_s;   // the attempt ends
    double optic_deg; // the tilt of the optic that it needs; NAN: any

    // The pass mark: all goals met, in so much time, with so many errors and no sentinel.
    double pass_time_s;
    int pass_errors;
    char source[TASK_TEXT_MAX]; // of the pass mark

    int goal_count;
    struct goal goals[TASK_GOALS_MAX];
    int error_count;
    struct task_error errors[TASK_ERRORS_MAX];
};

#define TASK_FILE_MAX 8192 // bytes

// A file, and the task that it says. The text has no end but its size.
struct task_file {
    struct task task;
    size_t size;
    char text[TASK_FILE_MAX];
};

// Reads and checks a file. RESULT_MISSING: it cannot be read, or lacks a key; RESULT_FORMAT,
// RESULT_INVALID, RESULT_LIMIT; the error names file, line or section, and key.
enum result task_load(const char *path, struct task *out_task, struct error *err);
enum result task_read(const char *path, struct task_file *out_file, struct error *err);

// The same for the text of a file; path: NAME.ini, for its name and for errors.
enum result task_parse(const char *path, const char *text, size_t size, struct task *out_task,
                       struct error *err);
