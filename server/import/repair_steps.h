// The parts of repair_mesh. Each works in place on a mesh that passes mesh_validate.
#pragma once

#include "import/repair.h"

// Widens the place of a kind.
void repair_at(struct repair_report *report, enum repair_kind kind, vec3 p);
void repair_at_triangle(struct repair_report *report, enum repair_kind kind,
                        const struct mesh *mesh, uint32_t triangle);

// Keeps the triangles that are marked, with their flags in `flags` where that is not NULL.
void repair_keep(struct mesh *mesh, const bool *kept, bool *flags);

// Step 1; may leave triangles with repeated corners.
void repair_weld(struct mesh *mesh, double weld_mm, struct repair_report *report);

// The second half of step 2.
void repair_duplicates(struct mesh *mesh, struct repair_report *report);

// Step 3.
void repair_fins(struct mesh *mesh, struct repair_report *report);

// Steps 4 and 5. `turned`: for each triangle whether it has been turned.
void repair_sheets(struct mesh *mesh, bool *turned, struct repair_report *report);

// Steps 6 and 7.
void repair_islands(struct mesh *mesh, double share, bool *turned, struct repair_report *report);
void repair_outward(struct mesh *mesh, bool *turned);

// Counts closed components inside of another one.
void repair_voids(const struct mesh *mesh, struct repair_report *report);
