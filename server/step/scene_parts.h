// The members of struct scene. Private to this room.
#pragma once

#include "case/case.h"
#include "match/match.h"
#include "quality/quality.h"
#include "step/job.h"
#include "step/loose.h"
#include "warp/adaptive.h"
#include "warp/warp.h"

_Static_assert(CASE_GROUPS_MAX <= WARP_SURFACES_MAX, "every group of a case is a surface");

// A cuttable group.
struct scene_tissue {
    int group;
    struct box box;              // of S'
    struct cut_mesh *mesh;       // S' without its tear
    struct cut_mesh *solid;      // S' with it; NULL where it has none
    struct match_surface *match; // NULL where the group has no S'_max
    struct quality_plan *plan;
    // What sessions begin with: S' − S, its mean and its integral, which are those of the group, or
    // made here where the group has no S'.
    const float *start;
    const struct surface_mean *start_mean;
    const struct surface_integral *start_integral;
    struct {
        float *zeros;
        struct surface_mean *mean;
        struct surface_integral *integral;
    } made;
    struct tissue_figures whole; // of the uncut tissue; its mesh has no number
};

struct scene {
    struct knee_case *knee;
    struct mesh outer[CASE_GROUPS_MAX]; // of each group, what instruments can touch
    struct query *queries[CASE_GROUPS_MAX];
    struct surface_tree *trees[CASE_GROUPS_MAX]; // of groups with a displacement, now or after cuts
    struct surface_mean *means[CASE_GROUPS_MAX]; // of groups with S'
    struct surface_blocks *blocks[CASE_GROUPS_MAX];
    struct surface_integral *integrals[CASE_GROUPS_MAX]; // of S', of S where there is none
    struct warp_surface surfaces[CASE_GROUPS_MAX];
    struct adaptive *adaptive[ADAPTIVE_COUNT]; // of the case's torn ligaments
    struct loose_ground *loose_ground;         // NULL: the case has no loose bodies
    int tissue_count;
    struct scene_tissue tissues[TISSUES_MAX];
};

// The corrections M of all bodies, in the frame of T_frame_body. The tibia's follows from its pose
// relative to the femur; the others are the identity.
void scene_correct(const struct scene *scene, enum adaptive_kind kind, enum adaptive_ramp ramp,
                   const pose T_frame_body[BODY_COUNT], struct adaptive_warp *out_adaptive,
                   pose out_correction[BODY_COUNT]);
