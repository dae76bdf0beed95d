// The parts of `arthron-bench cut`.
#pragma once

#include "bench.h"
#include "cutting/trial.h"
#include "samples.h"
#include "step/scene.h"
#include "touch_moves.h"

bench_run bench_cut;

// What all parts add up to.
struct cut_totals {
    int changes;  // cuts that changed the mesh
    int failures; // cuts that were refused
    int breaks;   // cuts after which something in cut.h did not hold
    int retried;  // changes with a retry
    double sigma; // largest distance of a removed volume from random points', in sigmas
    int crossings_15, crossings_300; // most pairs at the end of a sequence of so many changes
    struct samples delta_share;      // of changes on the meniscus of 20k triangles
    // Of the thread's own time, the worst over the bodies that are timed:
    double p50_ms, p95_ms, max_ms; // of a change
    double knife_p95_ms;           // of a change by a knife that turns
    double job_over_kernels;       // jobs over the cuts and matches in them
    char first_fault[512];         // "" where there is none
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
    bool is_timed;    // its times count
    bool is_20k;      // the whole meniscus of 20k triangles: its messages count
    int sequences[3]; // of 15, 100 and 300 changes
};

void cut_sequences(const struct cut_plan *plan, struct report *report, struct cut_totals *totals);

// The same bites into two rods of the same density, one with 80k triangles more, far away: the
// ratio of the median times.
double cut_growth_far(int bites, struct report *report, struct cut_totals *totals);

// What punch, shaver and knife take along random moves, on the meniscus of 20k triangles.
void cut_instruments(const struct mesh *mesh, int moves, struct report *report,
                     struct cut_totals *totals);
// The same for a knife that turns so fast that its cuts have six parts or more.
void cut_by_knife(const char *name, const struct mesh *mesh, int moves, struct report *report,
                  struct cut_totals *totals);

// Jobs that a session would ask for, in a planned resection.
struct cut_resection {
    const char *name;
    const struct scene *scene;
    const struct touch_moves *moves;
};

void cut_jobs(const struct cut_resection *resection, struct report *report,
              struct cut_totals *totals);

// Sequences, a knife and jobs on the meniscus that a recipe tears, fine_knee.h's; with the folder
// of a case, on that one's.
enum result cut_lesion(const char *dir, const char *recipe, bool quick, struct report *report,
                       struct cut_totals *totals, struct error *err);
