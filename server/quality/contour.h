// How wide the tissue is in plan, from the rim inwards, on rays that leave the rim 0.25 mm apart.
#pragma once

#include "quality/lattice.h"
#include "quality/zones.h"

struct contour_step {
    uint32_t column;
    float mm; // of the ray that are in the column
};

struct contour {
    int ray_count;
    uint32_t *first_steps;      // ray_count + 1
    struct contour_step *steps; // of a ray: from the rim inwards, columns with tissue only
    double *widths;             // of each ray, uncut
};

// tissue: how many samples of each column are tissue. The roots of the horns, where the width ends,
// get no rays. The caller releases it with contour_fini.
void contour_init(struct contour *contour, const struct zones *zones, const struct lattice *lattice,
                  const uint16_t *tissue);
void contour_fini(struct contour *contour);

// left: how many samples of each column's tissue are left; a column is there while a quarter of it
// is. rim: the least width that is left. step: how much more the widths of two rays within 1 mm
// differ than they did uncut, at most.
void contour_measure(const struct contour *contour, const uint16_t *tissue, const uint16_t *left,
                     double *out_rim_mm, double *out_step_mm);
