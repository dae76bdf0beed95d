// A trainee's hands and the joint, computed from the anatomy of a case: what a mock-up plays.
//
// Everything is in the mock-up's frame, which is the femur's. An instrument is a line through its
// portal; its tip's frame has z along the shaft, away from the handle, and y as far proximal as
// that allows: there a punch opens. With a tremor of 0 a tip that palpates lies exactly on the
// surface S of its group, and no shaft is deeper than MOTION_DEPTH_MAX inside a bone.
#pragma once

#include "base/sample.h"
#include "case/case.h"

#include <stdio.h>

#define MOTION_DEPTH_MAX 0.05 // mm

enum motion_verb {
    MOTION_APPROACH, // an instrument goes in through a portal
    MOTION_PALPATE,  // the probe slides along a straight line, projected on a group's surface
    MOTION_FLEX,
    MOTION_VALGUS,
    MOTION_DRAWER, // the tibia glides forward
    MOTION_BITE,   // an instrument opens, goes to a point of a group, and closes
    MOTION_RESECT, // bites along the planned resection of a group
    MOTION_TRACE,  // a probe or a shaver goes along the margin of a planned resection
    MOTION_LOOK,   // the scope goes to where it sees a group, or a place of it
    MOTION_STAND,  // the scope goes to where it sees two places by turning its optic alone
    MOTION_TURN,   // the optic turns about the scope's axis until it looks towards a place
    MOTION_TOUCH,  // an instrument's tip goes to a place of a group, or as near as it comes, and
                   // rests there
    MOTION_TAKE,   // a jaw goes to a loose body, closes on it, withdraws and opens
    MOTION_WAIT,   // all hands rest
    MOTION_WITHDRAW,
    MOTION_VERB_COUNT
};

// A point, or a landmark and how far beside it. x is lateral on both knees.
struct motion_place {
    char landmark[CASE_NAME_MAX]; // empty: `at` is a point in the group's frame
    vec3 at;                      // with a landmark: from there, along the joint's axes
};

struct motion_step {
    enum motion_verb verb;
    enum channel tool;
    char name[CASE_NAME_MAX]; // of the portal, the group or the loose body
    bool has_place; // a bite without one takes the reachable point nearest to the group's middle
    struct motion_place from, to;
    // Degrees of flexion or valgus, mm of drawer, seconds of touching or waiting, mm from which to
    // look (0: as it comes).
    double amount;
    int64_t count; // of bites, at most
    // Of a bite, a take and a look, not in a script: the place is the tip's own, on no surface, and
    // the jaw of a bite or the optic is turned so about the shaft.
    bool is_free;
    double roll_deg;
};

const char *motion_verb_name(enum motion_verb verb); // as the script spells it

#define MOTION_STEPS_MAX 256
#define MOTION_OPTIC_DEG 30.0 // of a script that does not say it

struct motion_script {
    double rate_hz;
    double speed_mm_s;        // a tip's highest speed
    double joint_speed_deg_s; // the joint's
    double tremor_mm;         // root mean square of a tip's tremor, 8 to 12 Hz
    double optic_deg;         // tilt of the scope's optic
    int64_t seed;
    bool skips; // leaves out steps that cannot be played
    int step_count;
    struct motion_step steps[MOTION_STEPS_MAX];
};

// Reads a script (INI); cases/README.md describes it. The error names file, section, key, range.
enum result motion_script_load(const char *path, struct motion_script *out_script,
                               struct error *err);

struct motion_tool {
    enum channel channel;
    vec3 portal;
};

struct motion_tool_state {
    pose T_mockup_tip; // the quaternion's sign never jumps
    double opening;    // 0 closed, 1 open; of a shaver: 1 while it runs
};

struct motion_row {
    double t_seconds;
    struct joint_angles joint;
    struct motion_tool_state tools[INSTRUMENT_COUNT];
    const struct case_group *touch; // what the probe's tip touches, or NULL
};

struct motion {
    int tool_count; // those that the script names, in its order
    struct motion_tool tools[INSTRUMENT_COUNT];
    size_t row_count;
    struct motion_row *rows;
    int skipped_count;
    struct error *skipped; // why, for each step that was left out
};

// Plays the script on a case. Where the case lacks a landmark that the script names, all landmarks
// are proposed first, in memory. RESULT_MISSING: the case has no such group, portal or landmark,
// the group no plan; RESULT_INVALID: a place that cannot be reached from the portal, or a line that
// leaves the surface. The error names the step by its number and verb. The motion points into the
// case; the caller releases it. A script that skips steps is refused where none is left at which an
// instrument does something.
enum result motion_plan(struct knee_case *knee, const struct motion_script *script,
                        struct motion *out_motion, struct error *err);
void motion_fini(struct motion *motion);

// The case in memory gets what hands need: portals where it has none, and where `landmarks` is set,
// all landmarks. motion_plan does so by itself. RESULT_INVALID where none are found.
enum result motion_prepare(struct knee_case *knee, bool landmarks, struct error *err);

// The columns are described in cases/README.md. RESULT_IO where the file does not take them.
enum result motion_write(const struct motion *motion, FILE *file, struct error *err);
