// What is still there of a tissue about its planned resection, as samples: what a bite would take
// of the plan, and what beyond it. For this room only.
#pragma once

#include "base/instrument.h"
#include "case/case.h"

struct remains {
    int count;
    vec3 *points; // in the frame of the tissue
    bool *is_planned, *is_there;
};

// now: the tissue before any cut. The caller releases it with remains_fini.
enum result remains_init(struct remains *remains, const struct case_group *group,
                         const struct mesh *now, struct error *err);
void remains_fini(struct remains *remains); // zeroed ones are fine

// After cuts.
enum result remains_take(struct remains *remains, const struct mesh *now, struct error *err);

struct bite_gain {
    double planned_mm3, beyond_mm3;
};

// Of a jaw that closes there from wide open.
struct bite_gain remains_bite(const struct remains *remains, const struct instrument *jaw,
                              pose T_mesh_tip);
