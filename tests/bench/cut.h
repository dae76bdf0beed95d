// The parts of `arthron-bench cut`.
#pragma once

#include "bench.h"
#include "cutting/trial.h"
#include "samples.h"

bench_run bench_cut;

// What all parts add up to.
struct cut_totals {
    int changes;  // cuts that changed the mesh
    int failures; // cuts that were refused
    int breaks;   // cuts after which something in cut.h did not hold
    int retried;  // changes with a retry
    double sigma; // largest distance of a removed volume from random points', in sigmas
    int crossings_15, crossings_300;    // most pairs at the end of a sequence of so many changes
    struct samples ms_20k, delta_share; // of changes on the menisci of 20k triangles
    char first_fault[512];              // "" where there is none
};

// Counts the trial's last cut.
void cut_count(struct cut_totals *totals, const struct trial *trial, const char *where, int cut);

// The size of a change as a message, and that of the whole mesh.
size_t cut_change_bytes(const struct cut_mesh *mesh, const struct cut_change *change);
size_t cut_mesh_bytes(const struct cut_mesh *mesh);

// Random sequences (cutting/bites.h) on one body; figures begin with `name`.
struct cut_plan {
    const char *name;
    const struct mesh *mesh;
    bool is_20k;
    int sequences[3]; // of 15, 100 and 300 changes
};

void cut_sequences(const struct cut_plan *plan, struct report *report, struct cut_totals *totals);

// The same bites into two rods of the same density, one with 80k triangles more, far away: the
// ratio of the median times.
double cut_growth_far(int bites, struct report *report, struct cut_totals *totals);

// What punch, shaver and knife take along random moves, on a body.
void cut_instruments(const struct mesh *mesh, int moves, struct report *report,
                     struct cut_totals *totals);
