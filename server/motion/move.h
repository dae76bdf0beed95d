// Rows of a motion: hands and the joint move segment by segment, each with the speed of a smooth
// reach, and every row is checked against the bones.
#pragma once

#include "mesh/solid.h"
#include "motion/joint.h"
#include "motion/motion.h"
#include "motion/tremor.h"

struct hand {
    enum channel channel;
    struct case_portal portal;
    vec3 tip;       // femur's frame, without tremor
    double opening; // of a shaver: 1 while it runs
    bool inside;    // outside, the tip rests before the portal
    struct tremor tremor;
    quat rotation; // of the last row, without the roll
    double roll;   // about the shaft, radians
};

struct plan {
    struct knee_case *knee;
    const struct motion_script *script;
    struct motion *motion;
    size_t row_capacity;
    struct solid bones[BODY_COUNT]; // without a mesh where the case has no such bone
    struct joint_angles joint;
    struct joint_hold hold;
    struct hand hands[INSTRUMENT_COUNT]; // as motion->tools
    struct error *err;
};

// Bones and landmarks. plan: knee, script, motion (zeroed) and err are set. The script's steps need
// not be there: its manner and the landmarks that it names count. The caller releases it with
// plan_end, after an error too.
enum result plan_begin(struct plan *plan);
void plan_end(struct plan *plan);

// An instrument that rests before a portal, which it keeps. All are taken up before the first row.
enum result plan_take_up(struct plan *plan, enum channel tool, const char *portal);
struct hand *plan_hand(struct plan *plan, enum channel tool); // NULL: not taken up

// Appends the rows of a step. Where it is refused nothing has changed.
enum result plan_step(struct plan *plan, const struct motion_step *step);

// To go back to a place of the motion: rows after it are dropped.
struct plan_mark {
    struct joint_angles joint;
    struct joint_hold hold;
    struct hand hands[INSTRUMENT_COUNT];
    size_t row_count;
};
struct plan_mark plan_mark(const struct plan *plan);
void plan_back(struct plan *plan, const struct plan_mark *mark);

// Instruments turn from one target to the next this far inside the portal, mm, or nearer to it
// where bones need that.
#define MOTION_SAFE_DEPTH 15.0

// Outside, they rest so far before it, clear of the skin, mm.
#define MOTION_REST 20.0

pose plan_body_pose(const struct plan *plan, enum body body); // T_femur_body
vec3 plan_up(const struct plan *plan);                        // away from the tibia
vec3 hand_rest(const struct case_portal *portal);
double hand_depth(const struct hand *hand);             // inside the portal, mm
vec3 hand_direction(const struct hand *hand, vec3 tip); // of the shaft with the tip there

// Whether the shaft with its tip there passes all bones, with some of MOTION_DEPTH_MAX to spare for
// what lies between two such tips.
bool plan_is_clear(const struct plan *plan, const struct hand *hand, vec3 tip);

// The same, and where the bite begins.
bool plan_bites_at(const struct plan *plan, const struct hand *hand, vec3 tip);

// T_femur_tip of an instrument that is turned so about its shaft, without tremor.
pose plan_tool_pose(const struct plan *plan, const struct hand *hand, vec3 tip, double roll);

// Whether no bone lies between two points, the last MOTION_SPARE of the way apart.
#define MOTION_SPARE 3.0 // mm
bool plan_sees(const struct plan *plan, vec3 from, vec3 to);

// RESULT_INVALID: names the bone through which the shaft with its tip there runs deepest.
enum result plan_refuse(const struct plan *plan, const struct hand *hand, vec3 tip);

// All of these append rows; RESULT_INVALID where an instrument would run through a bone.
enum result plan_add_row(struct plan *plan, const struct case_group *touch);
enum result plan_move(struct plan *plan, struct hand *hand, vec3 to); // straight
enum result plan_open(struct plan *plan, struct hand *hand, double opening);
// From plan_before_bite: opens, goes to the target, closes, and backs off to where it was.
enum result plan_bite(struct plan *plan, struct hand *hand, vec3 target);
vec3 plan_before_bite(const struct hand *hand, vec3 target);
// From plan_before_grasp, farther off: opens, goes to the target and closes.
enum result plan_grasp(struct plan *plan, struct hand *hand, vec3 target);
vec3 plan_before_grasp(const struct hand *hand, vec3 target);

// The hand turns the instrument about its shaft.
enum result plan_roll(struct plan *plan, struct hand *hand, double roll);

// A smooth reach of so many rows (minimum jerk), so that nothing is faster than highest_speed.
int plan_rows(const struct plan *plan, double way, double highest_speed);
double plan_progress(int row, int rows); // 0 to 1
