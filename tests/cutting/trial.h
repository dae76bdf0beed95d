// A mesh that is cut, and looked at as a whole after each cut.
#pragma once

#include "cutting/change.h"
#include "random.h"

struct trial {
    struct cut_mesh *mesh;
    uint32_t original; // vertices at the start
    // Of the last cut:
    struct snapshot before, now;
    double volume_before;
    enum cut_outcome outcome;
    struct cut_change change; // zeroed where nothing changed
    struct error err;
    const char *fault; // what is wrong, NULL where nothing is
    int64_t took_ns;   // by cut_apply, on the clock
    int64_t own_ns;    // of it, by this thread: not while others had the processor
};

// The mesh must be one that cut_mesh_create takes. Released with trial_fini.
void trial_init(struct trial *trial, const struct mesh *mesh);
void trial_fini(struct trial *trial);

// Cuts, and holds what happened against cut.h: a change by change_fault; where nothing changed,
// that nothing did, to the bit. A refusal is no fault: whether it is one the caller knows.
void trial_cut(struct trial *trial, const struct convex *parts, int part_count);

// Random points in and around the parts, after a cut that changed the mesh: inside of it or of a
// piece should be who was inside before and is in no part. NULL, or what is wrong. *inside grows by
// those that were inside before.
const char *trial_points_fault(const struct trial *trial, const struct convex *parts,
                               int part_count, int points, struct random *random, int *inside);
