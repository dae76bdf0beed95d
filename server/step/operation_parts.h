// What the files of an operation share; for them alone.
#pragma once

#include "step/fitting.h"
#include "step/operation.h"
#include "step/settings.h"
#include "step/tissue_state.h"

#define CHECKPOINTS_MAX 2

// A cut that changed the tissue.
struct past_cut {
    uint64_t number; // counts all cuts of the operation
    uint32_t stroke;
    struct blade_move move;
    struct tissue_figures before;
    uint32_t fits; // of the touch, by then
};

struct checkpoint {
    uint32_t cuts; // that were made by then; 0: nothing is kept
    struct tissue_state state;
};

// Until a job comes, the tissue is the scene's: `now` has figures alone, and there is no fitting.
struct operated_tissue {
    const struct scene_tissue *scene;
    const struct case_group *group;
    int rules;
    const struct instruments *instruments; // of the operation
    struct tissue_state now;
    struct fitting *fitting; // the touch; NULL: by blends, or it never gives way
    double *touch_before;    // of all vertices: before the last job
    uint32_t fitted_since;   // the number of the last cut that the touch has followed
    struct past_cut *cuts;   // since it was whole
    uint32_t cut_count, cut_room;
    bool was_read;                                  // with its cuts: they may come from anywhere
    struct checkpoint checkpoints[CHECKPOINTS_MAX]; // the newest first
};

struct operation {
    int count;
    struct instruments instruments;
    uint64_t cuts; // so many were made, undone ones too
    struct operated_tissue tissues[TISSUES_MAX];
};

// Numbers for each vertex, as in struct touch_change; 0: the tissue never gives way.
static inline int operated_touch_width(const struct operated_tissue *t) {
    return !t->scene->match ? 0 : t->rules >= RULES_TOUCH_FITTED ? 3 : 1;
}

static inline const struct cut_mesh *operated_mesh(const struct operated_tissue *t) {
    return t->now.mesh ? t->now.mesh : t->scene->mesh;
}

// ---- operation.c ----
void operated_take_over(struct operated_tissue *t); // it gets memory of its own, before a job

// ---- operation_mismatch.c ----
vec3 operated_touched(const struct operated_tissue *t, uint32_t vertex); // S''
void operated_measure_mismatch(struct operated_tissue *t); // into its figures, once it is fitted
