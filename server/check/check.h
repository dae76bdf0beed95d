// The check of a case before a trainee uses it.
//
// After the inspection (check/inspect.h) and a look at what overlaps and what should touch over
// flexion (check/contact.h), the check walks the reachable space of the joint over
// flexion, and in the key poses of torn ligaments. It looks for folds, gain, jumps, touch errors
// and facing surfaces (check/field.h, check/facing.h). A case with a fault is unfit. A case with
// only warnings is fit with warnings.
//
// Faults: those of inspect.h, portal.h and landmark.h; bones and menisci beyond the bounds of
// check/bounds.h; a torn
// ligament whose key is not met; a rest pose that ligaments move; a touch error above 1e-4 mm; in a
// rest pose, displacements that fill the gap between surfaces that face each other within 1 mm, or
// that fold the field in a wider gap; folds in more than FOLDS_MAX of the warped space; a virtual
// tibia that sinks more than SUNK_MAX_MM deeper into the femur than the mock-up's.
//
// Between S' and maxcut, where cuts leave the touched surface and easing takes it, the surface
// itself is looked at (check/inspect.h), and the field every 60 degrees on a grid twice as coarse.
//
// Warnings: fewer folds; more than FOLDS_MAX of them between S' and maxcut; jumps; facing surfaces
// whose displacements differ by more than their gap; a tibia that sinks in by less; filled gaps in
// key poses. There, two bones that slide past each other have different displacements and press the
// tissue between them. The check reports by how much, and counts this among the folds. The skin
// gives way, so it faces no surface.
#pragma once

#include "check/contact.h"
#include "check/facing.h"
#include "check/field.h"
#include "check/grade.h"
#include "check/inspect.h"
#include "check/ligaments.h"

#define CHECK_POSES_MAX (16 + CASE_KEYS_MAX)
#define FOLDS_MAX 0.01
#define SUNK_MAX_MM 1.0
#define SUNK_MM 0.1

struct check_settings {
    struct field field;
    enum adaptive_kind adaptive;
    double spacing_mm; // of the grid
    double flexion_step_deg;
    bool quick; // of the keys of each ligament only the first; said in the result
    // NULL, or told how much of the check is done, from 0 to 1, and what it looks at: overlaps, or
    // the field at a pose. From any thread, never two calls at once.
    void (*progress)(void *context, const char *what, double share);
    void *context;
};

// Those of a session by default; 0.5 mm, every 15 degrees; quick: 1 mm, every 60.
struct check_settings check_settings_default(bool quick);

// At one pose of the joint.
struct check_pose {
    char name[CASE_NAME_MAX + 16]; // "30 degrees", "mcl at 15 degrees"
    struct joint_angles joint;
    int key;       // of the case, -1: none
    bool is_still; // nothing is displaced: all figures are 0
    uint64_t places[PLACE_COUNT];
    struct field_figures *field;
    struct field_figures *eased; // between S' and maxcut; NULL: not looked at
    struct touch_figures touch;
    struct facing_figures *facing;
    struct key_figures bones; // with a key
    double gain;              // with a key: of its ligament
};

struct case_check {
    struct check_settings settings;
    char *case_or_folder; // the name of a case, or the folder that holds none
    uint64_t hash;
    struct inspection findings;
    struct contacts contacts; // at rest
    enum grade grade;
    double rest_mm; // the largest displacement of the rest pose by torn ligaments
    int pose_count;
    struct check_pose poses[CHECK_POSES_MAX];
    struct field_figures *field, *eased; // of all poses together
    // Where the worst of all poses is, -1: nowhere. eased_pose: of folds between S' and maxcut.
    int gain_pose, fold_pose, filling_pose, fading_pose, jump_pose, eased_pose;
    int opening_count;
    struct opening openings[CASE_LIGAMENTS_MAX];
    int group_count; // names of the groups that surfaces stand for
    char groups[CASE_GROUPS_MAX][CASE_NAME_MAX];
    uint32_t group_colours[CASE_GROUPS_MAX]; // 0xRRGGBB
};

// Takes *knee, which becomes NULL. Where it cannot even be prepared, that is its fault in the
// result, and *out_scene is NULL; otherwise the scene is the caller's. RESULT_IO or RESULT_LIMIT
// where the check cannot be made. The caller releases *out_check with check_destroy.
enum result check_case(struct knee_case **knee, const struct check_settings *settings,
                       struct case_check **out_check, struct scene **out_scene, struct error *err);
void check_destroy(struct case_check **check); // NULL inside is fine

// A check of a folder without a case that can be loaded: one fault, why.
struct case_check *check_of_none(const char *folder, const struct check_settings *settings,
                                 const struct error *why);

// Roles of the scene's surfaces in its reachable space, and for a case without a skin the planes
// that it ends at (at most CONVEX_PLANES_MAX), in the femur's frame: those about the bones within
// 60 mm of the joint's centre, 10 mm outside of them; how many.
void check_roles(const struct scene *scene, struct space_surface out_surfaces[CASE_GROUPS_MAX]);
int check_planes(const struct scene *scene, const struct scene_stance *stance,
                 struct plane *out_planes);
