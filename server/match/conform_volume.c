#include "match/conform_parts.h"

#include <math.h>

#define STEPS_MAX 12
#define FIRST_MM 0.2 // at most, of any vertex
#define NEXT_MM 0.05

double conform_live_volume(const struct conform *c) {
    double six = 0;
    for (uint32_t i = 0; i < c->live_count; i++) {
        vec3 p[3];
        conform_corners(c, c->live[i], p);
        for (int k = 0; k < 3; k++)
            p[k] = vec3_sub(p[k], c->origin);
        six += vec3_dot(p[0], vec3_cross(p[1], p[2]));
    }
    return six / 6;
}

// Of the volume, by the place of an active vertex.
static vec3 slope_of(const struct conform *c, uint32_t vertex) {
    vec3 sum = {0};
    for (uint32_t k = c->surface->first[vertex]; k < c->surface->first[vertex + 1]; k++)
        sum = vec3_add(sum,
                       vec3_cross(vec3_sub(c->positions[c->surface->opposites[k].from], c->origin),
                                  vec3_sub(c->positions[c->surface->opposites[k].to], c->origin)));
    return vec3_scale(1.0 / 6, sum);
}

static double slope_along(const struct conform *c) {
    double sum = 0;
    for (uint32_t i = 0; i < c->active_count; i++)
        sum += vec3_dot(slope_of(c, c->active[i]), c->along[i]);
    return sum;
}

static double find_way(struct conform *c) {
    double longest = 0;
    for (uint32_t i = 0; i < c->active_count; i++)
        c->bent[i] = slope_of(c, c->active[i]);
    conform_solve(c, c->bent, c->plan->way_energy, c->along);
    for (uint32_t i = 0; i < c->active_count; i++) {
        if (!(c->trust[c->active[i]] > 0))
            c->along[i] = (vec3){0};
        longest = higher(longest, vec3_length(c->along[i]));
    }
    return longest;
}

void conform_settle(struct conform *c, double wanted_mm3, double tolerance_mm3) {
    double longest = find_way(c);
    for (int step = 0; step < STEPS_MAX; step++) {
        double lacking = wanted_mm3 - conform_live_volume(c), slope = slope_along(c);
        if (fabs(lacking) <= tolerance_mm3 || !(slope > 0))
            return;
        double most = (step ? NEXT_MM : FIRST_MM) / longest;
        double t = higher(-most, lower(most, lacking / slope));
        for (uint32_t i = 0; i < c->active_count; i++) {
            vec3 *p = &c->positions[c->active[i]];
            *p = vec3_add_scaled(*p, t, c->along[i]);
        }
    }
}
