// The width of the tissue seen from above, along rays that leave the rim 0.25 mm apart.
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

// left: how many samples of tissue each column still has; a column counts while a quarter of it is
// left. rim: the least width left. step: the largest difference of the widths of two rays within 1
// mm, beyond their difference before any cut.
void contour_measure(const struct contour *contour, const uint16_t *tissue, const uint16_t *left,
                     double *out_rim_mm, double *out_step_mm);
