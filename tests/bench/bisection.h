// Algorithm 1 of the paper, bounded so that it always ends: a reference for match/match.h with the
// same brushes and blends, which shares no code with it. Each round displaces the whole surface and
// sums its whole volume.
#pragma once

#include "match/match.h"

struct bisection;

// Arguments as of match_surface_create.
struct bisection *bisection_create(const struct mesh *mesh, const float *warp, const float *maxcut);
void bisection_destroy(struct bisection **bisection); // NULL inside is fine
const double *bisection_blends(const struct bisection *bisection);
double bisection_volume(const struct bisection *bisection); // inside S'', summed anew

// As match_to_volume, to tolerance_mm3 (the paper's ε). The report lists no changed vertices.
void bisection_match(struct bisection *bisection, const struct brush *brushes, int brush_count,
                     double target_mm3, double tolerance_mm3, struct match_report *out_report);
