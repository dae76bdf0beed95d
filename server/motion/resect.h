// The planned resection of a group, as hands carry it out on the mock-up: bites along the inner
// margin, then a way along it.
//
// The mock-up's meniscus is rigid and whole. What has been cut shows in the virtual one only, and
// the session moves instruments accordingly: a hand that bites at the physical inner margin bites
// at the virtual one. So all bites straddle the physical inner margin, and go round again.
#pragma once

#include "case/arc.h"
#include "motion/move.h"

#define RESECTION_SAMPLES 256

struct resection {
    const struct case_group *group;
    struct mesh whole; // S', where the plan is
    struct query *query;
    struct arc *arc;
    double depths[RESECTION_SAMPLES + 1]; // of the plan from the inner margin, over the arc
    double from, to;                      // shares of the arc between which there is a plan
};

// RESULT_MISSING where the group has no plan. The caller releases it, after an error too.
enum result resection_init(struct resection *resection, const struct knee_case *knee,
                           const struct case_group *group, struct error *err);
void resection_fini(struct resection *resection);

// At most so many bites, from the anterior end of the plan to the posterior one and from the start
// again, each with the tip under the meniscus, 3.5 mm from its inner margin, or as deep as the plan
// still is there. Places that the shaft does not reach past the bones are left out; RESULT_INVALID
// where that leaves none.
enum result resection_bite(const struct resection *resection, struct plan *plan, struct hand *hand,
                           int count);

// The tip goes along the inner margin as far as the plan and the shaft reach: a probe slides on the
// upper side, a shaver runs 1 mm off the margin.
enum result resection_trace(const struct resection *resection, struct plan *plan,
                            struct hand *hand);
