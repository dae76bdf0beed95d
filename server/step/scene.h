// A case prepared for sessions.
#pragma once

#include "case/case.h"
#include "warp/adaptive.h"
#include "warp/warp.h"

struct cut_mesh;

// Surfaces, search structures, tissue that can be cut. Immutable; any number of sessions on any
// threads share one.
//
// If scene_create succeeds, it takes ownership of *knee, which becomes NULL. RESULT_INVALID: a tear
// leaves no tissue, or the key of a torn ligament is not met (warp/adaptive.h). RESULT_LIMIT: the
// case has more than TISSUES_MAX cuttable groups, or one of them is longer than 500 mm.
struct scene;

enum result scene_create(struct knee_case **knee, struct scene **out_scene, struct error *err);
void scene_destroy(struct scene **scene);
const struct knee_case *scene_case(const struct scene *scene);
int scene_tissue_count(const struct scene *scene);
const struct cut_mesh *scene_tissue_mesh(const struct scene *scene, int tissue); // before any cut
int scene_tissue_group(const struct scene *scene, int tissue); // its index in the case's groups

// The adaptive warp of a case's torn ligaments. The caller destroys it. RESULT_INVALID names a key
// that is not met.
enum result scene_adaptive(const struct knee_case *knee, enum adaptive_kind kind,
                           struct adaptive **out_adaptive, struct error *err);

// The case as the kernels see it at one pose of the joint, before any cut, the femur at the
// identity: for checks and benches. Must not move in memory.
struct scene_stance {
    pose T_femur_body[BODY_COUNT];
    pose correction[BODY_COUNT]; // M
    struct adaptive_warp adaptive;
    struct warp_scene warp;
};

void scene_stand(const struct scene *scene, enum adaptive_kind kind,
                 const struct joint_angles *joint, struct scene_stance *out_stance);
