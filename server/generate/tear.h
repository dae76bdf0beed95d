// Tears of a meniscus as surgeons name them, made into a lesion: the cleft, the damaged tissue, and
// the planned resection, which takes the damage out and leaves a smooth inner contour.
#pragma once

#include "case/arc.h"
#include "case/case.h"

enum tear_kind {
    TEAR_RADIAL,        // from the inner margin outwards, across the fibres of the rim
    TEAR_FLAP,          // oblique from the inner margin, then turning along the arc
    TEAR_BUCKET_HANDLE, // upright, along the arc; the inner part stays attached at both ends
    TEAR_HORIZONTAL,    // a cleavage from the inner margin between an upper and a lower leaf
    TEAR_KIND_COUNT
};

bool tear_kind_from_name(const char *name, enum tear_kind *out_kind); // "bucket-handle"

struct tear {
    enum tear_kind kind;
    double at;        // share of the arc: 0 the anterior end, 1 the posterior one; its middle
    double depth_mm;  // from the inner margin
    double length_mm; // along the arc, at that depth; 0 for a radial tear
};

// Adds the tear to the group's lesion. A cleft is 0.15 mm wide; the plan stays rim_mm clear of the
// outer margin. arc: of the group's virtual mesh.
// RESULT_INVALID where the tear would come nearer than 1.5 mm to the outer margin or to an end, or
// a flap is not longer than deep.
enum result tear_add(struct case_group *group, const struct arc *arc, const struct tear *tear,
                     double rim_mm, struct error *err);

struct resection {
    double at;        // share of the arc, its middle
    double depth_mm;  // from the inner margin
    double length_mm; // along the arc, at that depth; beside it the resection runs out smoothly
};

// Puts this plan in the place of the group's. It stays rim_mm clear of the outer margin.
// RESULT_INVALID where it would reach an end, or the meniscus is hardly wider than the rim; the old
// plan stays then.
enum result plan_set(struct case_group *group, const struct arc *arc,
                     const struct resection *resection, double rim_mm, struct error *err);
