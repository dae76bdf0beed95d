// The meniscectomy of the paper (5.3, Fig. 11), on a case of ours: a punch bites fifteen times into
// the inner margin of the medial meniscus, in two rows, and after each bite the physical meniscus
// is matched.
#pragma once

#include "bisection.h"
#include "case/case.h"
#include "cut/blade.h"
#include "match/match.h"

#define BITE_COUNT 15
#define SECTION_MM 10.0
#define ALGORITHM_1_MM3 2.0 // its ε: what the paper's volumes differ by

struct meniscectomy {
    const struct case_group *group;
    struct mesh whole; // S'
    struct match_surface *surface;
    struct blade_move bites[BITE_COUNT];
    struct convex section; // so much of the body, from margin to margin
    struct cut_mesh *cut;  // these three as the bites so far have left them
    struct match *match;
    struct bisection *bisection;
};

// The knee must outlive it. RESULT_MISSING where it has no medial meniscus that can be cut, or that
// has no maxcut.
enum result meniscectomy_init(struct meniscectomy *m, const struct knee_case *knee,
                              struct error *err);
void meniscectomy_fini(struct meniscectomy *m);
void meniscectomy_restart(struct meniscectomy *m);

enum work {
    WORK_CUT,
    WORK_MATCH,
    WORK_BISECTION, // the same match by Algorithm 1, to ALGORITHM_1_MM3
    WORK_COUNT
};

struct bite_report {
    double removed_mm3;
    double cut_mm3, warped_mm3; // inside the cut mesh and inside S'', each summed anew
    double ms[WORK_COUNT];
    int steps[WORK_COUNT]; // of the two matches
};

// The next one is the index. RESULT_REFUSED where the cut is.
enum result meniscectomy_bite(struct meniscectomy *m, int index, struct bite_report *out_report,
                              struct error *err);

void meniscectomy_warped(const struct meniscectomy *m, struct mesh *out_mesh); // S''

// How far the surfaces that cuts made are from S'', over their corners; 0 where nothing was cut.
// RESULT_IO where Embree cannot build.
enum result meniscectomy_gap(const struct meniscectomy *m, double *out_mean_mm,
                             double *out_largest_mm, struct error *err);
