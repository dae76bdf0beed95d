// The quality of a resection: removed volume compared with the plan, and the rim that is left.
//
// The tissue is a lattice of samples (0.25 mm) in the virtual mesh. Each sample has a zone and
// flags: planned for removal, removable (outside S'_max), damaged. Cuts remove samples. Zones
// follow the meniscus in plan, a C about the centre of the circle that fits it best: horns and body
// are thirds of its arc, and there are thirds from the inner margin to the rim. Millimetres, in the
// mesh's frame. Only create and copy allocate.
#pragma once

#include "base/kept.h"
#include "mesh/convex.h"

enum zone_along { ZONE_ANTERIOR_HORN, ZONE_BODY, ZONE_POSTERIOR_HORN, ZONE_ALONG_COUNT };
enum zone_across { ZONE_INNER, ZONE_MIDDLE, ZONE_OUTER, ZONE_ACROSS_COUNT };

struct zone_volumes {
    double mm3[ZONE_ALONG_COUNT][ZONE_ACROSS_COUNT];
};

// Of one cuttable group; immutable, shared by all sessions of a case.
struct quality_plan;

struct quality_setting {
    const struct mesh *tissue; // S', closed
    const struct mesh *least;  // S'_max, closed; NULL where there is none: nothing may go
    vec3 up, anterior;         // of the knee, in the mesh's frame, unit length
    const struct convex *plan; // what is to be resected: a union; none where the count is 0
    int plan_count;
    const struct convex *damage; // the damaged region: a union
    int damage_count;
};

struct quality_plan *quality_plan_create(const struct quality_setting *setting);
void quality_plan_destroy(struct quality_plan **plan); // NULL inside is fine

// The zone of a point, by its place in plan; a point off the meniscus has the nearest zone.
void quality_zone(const struct quality_plan *plan, vec3 p, enum zone_along *out_along,
                  enum zone_across *out_across);

// The signed share of one triangle in the volumes by zone of a closed mesh: that of the prism
// between it and a fixed plane, so that the sum over the mesh is the volume in each zone. times: 1,
// or -1 to take a triangle out again.
void quality_add_triangle(const struct quality_plan *plan, const vec3 corners[3], double times,
                          struct zone_volumes *volumes);

// The tissue of one session. The plan must outlive it.
struct quality;

struct quality *quality_create(const struct quality_plan *plan);
struct quality *quality_copy(const struct quality *quality); // of the same plan
void quality_destroy(struct quality **quality);
// Keeps it, or reads one of the same plan into a new one.
void quality_keep(struct quality *quality, struct kept *kept);

void quality_take_parts(struct quality *quality, const struct convex *parts, int count);
void quality_take_piece(struct quality *quality, const struct mesh *piece); // closed

struct quality_report {
    double removed_mm3; // all, by samples
    double planned_mm3; // the whole plan within the tissue
    double over_mm3;    // removed, but not planned
    double under_mm3;   // planned, but not removed
    double damage_mm3;  // damaged, and still there
    double rim_mm;      // least width in plan that is left from the rim inwards
    double step_mm;     // largest step of the inner contour within 1 mm along the rim
    struct zone_volumes whole, removed, budget; // by samples; budget: may go, down to S'_max
};

// Seen from above, a column of tissue counts while a quarter of it is left. The roots of the horns,
// 8 % of the arc at either end, do not count. A step is the difference of two widths beyond their
// difference before any cut. The lattice limits the resolution: the rim is within 0.4 mm, a step
// within 0.8 mm.
void quality_report(const struct quality *quality, struct quality_report *out_report);
