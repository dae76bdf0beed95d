#include "quality/contour.h"

#include "base/check.h"

#include <stdlib.h>

#define RAY_MM 0.25
#define NEIGHBOURS 4 // rays that begin within 1 mm of one
#define ROOT 0.08    // share of the arc at either end
#define MARCH_MM 0.05

// ---- rays ---------------------------------------------------------------------------------------

static vec3 rim_point(const struct zones *zones, double along) {
    double angle = zones_angle(zones, along), r = zones_rim(zones, angle);
    return (vec3){r * cos(angle), r * sin(angle), 0};
}

// Writes where the rays are along the arc, and returns how many there are. NULL counts them.
static int place_rays(const struct zones *zones, double *out_alongs) {
    const double end = 1 - ROOT, little = 1e-3;
    double way = RAY_MM;
    int count = 0;
    vec3 before = rim_point(zones, ROOT);
    for (double along = ROOT; along < end; along += little) {
        vec3 here = rim_point(zones, along);
        way += vec3_distance(before, here);
        before = here;
        if (way < RAY_MM)
            continue;
        if (out_alongs)
            out_alongs[count] = along;
        count++;
        way -= RAY_MM;
    }
    return count;
}

// The columns with tissue under a ray, from outside to the centre; NULL counts them.
static uint32_t march(const struct lattice *lattice, const uint16_t *tissue, double angle,
                      struct contour_step *out_steps) {
    double x = cos(angle), y = sin(angle), reach = 0;
    for (int corner = 0; corner < 4; corner++) {
        int column = (corner & 1 ? lattice->wide - 1 : 0) +
                     (corner & 2 ? lattice->deep - 1 : 0) * lattice->wide;
        reach = fmax(reach, vec3_length(lattice_column_place(lattice, column)));
    }
    uint32_t count = 0;
    int last = -1;
    for (int i = (int)(reach / MARCH_MM); i >= 0; i--) {
        int column = lattice_column_at(lattice, i * MARCH_MM * x, i * MARCH_MM * y);
        if (column < 0 || !tissue[column])
            continue;
        count += column != last;
        last = column;
        if (out_steps) {
            struct contour_step *step = &out_steps[count - 1];
            step->column = (uint32_t)column;
            step->mm += (float)MARCH_MM;
        }
    }
    return count;
}

static double width_of(const struct contour *contour, int ray, const uint16_t *tissue,
                       const uint16_t *left) {
    double width = 0;
    for (uint32_t i = contour->first_steps[ray]; i < contour->first_steps[ray + 1]; i++) {
        const struct contour_step *step = &contour->steps[i];
        if (4 * left[step->column] < tissue[step->column])
            break;
        width += (double)step->mm;
    }
    return width;
}

void contour_init(struct contour *contour, const struct zones *zones, const struct lattice *lattice,
                  const uint16_t *tissue) {
    int count = place_rays(zones, NULL);
    double *alongs = alloc((size_t)count + 1, sizeof *alongs);
    place_rays(zones, alongs);
    contour->ray_count = count;
    contour->first_steps = alloc((size_t)count + 1, sizeof *contour->first_steps);
    for (int ray = 0; ray < count; ray++)
        contour->first_steps[ray + 1] =
            contour->first_steps[ray] +
            march(lattice, tissue, zones_angle(zones, alongs[ray]), NULL);
    contour->steps = alloc((size_t)contour->first_steps[count] + 1, sizeof *contour->steps);
    contour->widths = alloc((size_t)count + 1, sizeof *contour->widths);
    for (int ray = 0; ray < count; ray++) {
        march(lattice, tissue, zones_angle(zones, alongs[ray]),
              contour->steps + contour->first_steps[ray]);
        contour->widths[ray] = width_of(contour, ray, tissue, tissue);
    }
    free(alongs);
}

void contour_fini(struct contour *contour) {
    free(contour->first_steps);
    free(contour->steps);
    free(contour->widths);
    *contour = (struct contour){0};
}

// ---- measuring ----------------------------------------------------------------------------------

void contour_measure(const struct contour *contour, const uint16_t *tissue, const uint16_t *left,
                     double *out_rim_mm, double *out_step_mm) {
    double rim = contour->ray_count ? INFINITY : 0, step = 0;
    double recent[NEIGHBOURS + 1] = {0};
    for (int ray = 0; ray < contour->ray_count; ray++) {
        double width = width_of(contour, ray, tissue, left);
        recent[ray % (NEIGHBOURS + 1)] = width;
        rim = fmin(rim, width);
        for (int k = 1; k <= NEIGHBOURS && k <= ray; k++) {
            double now = fabs(width - recent[(ray - k) % (NEIGHBOURS + 1)]);
            double uncut = fabs(contour->widths[ray] - contour->widths[ray - k]);
            step = fmax(step, now - uncut);
        }
    }
    *out_rim_mm = rim;
    *out_step_mm = step;
}
