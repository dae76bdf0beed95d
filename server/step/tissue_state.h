// One tissue as far as it is cut. For operation.c only.
#pragma once

#include "step/scene_parts.h"

struct tissue_state {
    struct cut_mesh *mesh;
    uint32_t number;     // of its last cut
    struct match *match; // blends; NULL where the touch is fitted, or the group has no S'_max
    // Where the touch is fitted: the same cuts into the tissue without its tears. NULL: the touch
    // is fitted to mesh.
    struct cut_mesh *solid;
    uint32_t solid_number;
    struct quality *quality;
    struct tissue_figures figures;
};

struct tissue_figures tissue_figures_whole(const struct scene_tissue *tissue); // number 0
struct tissue_state tissue_state_whole(const struct scene_tissue *tissue, int rules,
                                       uint32_t mesh_number);
struct tissue_state tissue_state_copy(const struct tissue_state *state);
void tissue_state_release(struct tissue_state *state);
// Keeps one whose touch is fitted, or reads it into a whole one.
void tissue_state_keep(struct tissue_state *state, const struct scene_tissue *tissue,
                       struct kept *kept);

// What the touch is fitted to, and the number of its last cut.
const struct cut_mesh *tissue_state_target(const struct tissue_state *state, uint32_t *out_number);

// One move of a blade: the meshes and the quality, and by blends the touch. Sets the result's
// outcome, change and error, and the touch of blends. The figures lack those of the resection.
// rules: of the session (step/settings.h).
void tissue_state_cut(struct tissue_state *state, const struct scene_tissue *tissue,
                      const struct instruments *instruments, const struct blade_move *move,
                      int rules, struct job_result *result);

// By blends: how far the cut's new surface is from S''.
double tissue_state_apart_mm(const struct tissue_state *state, const struct mesh *mesh,
                             const struct cut_change *change);
