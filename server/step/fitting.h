// The touched surface S'' of one tissue, fitted to the tissue after each job that cuts it
// (match/conform.h), and how to go back. For operation.c only.
#pragma once

#include "cut/cut.h"
#include "match/conform.h"

struct fitting;

// S'' = S'. mesh: S, whose triangles S'' has. The surface must outlive it. rules: of the session
// (step/settings.h).
struct fitting *fitting_create(const struct match_surface *surface, const struct mesh *mesh,
                               int rules);
void fitting_destroy(struct fitting **fitting); // NULL inside is fine

// Keeps it, or reads it into a new one of the same surface.
void fitting_keep(struct fitting *fitting, struct kept *kept);

vec3 fitting_vertex(const struct fitting *fitting, uint32_t vertex); // S''
// S'' as it was reported last: S before the first report.
const struct mesh *fitting_touched(const struct fitting *fitting);
vec3 fitting_offset(const struct fitting *fitting, uint32_t vertex); // S'' − S', rounded
void fitting_offsets(const struct fitting *fitting, double *out); // of all vertices: 3 numbers each
void fitting_place(struct fitting *fitting, uint32_t vertex, vec3 offset);

struct fitting_report {
    double volume_mm3;  // inside S''
    double left_mm3;    // by which S'' is larger than the target
    double distance_mm; // from the new surface to S'', the largest of a few points
};

// The target has new surface: that of its cuts with numbers above `since`. S'' then has rounded
// offsets (step/touch.h).
void fitting_follow(struct fitting *fitting, const struct cut_mesh *target, uint32_t since,
                    struct fitting_report *out_report);

// The same for an S'' that the caller placed after fitting_follow.
void fitting_follow_as_placed(struct fitting *fitting, const struct cut_mesh *target,
                              uint32_t since, struct fitting_report *out_report);

uint32_t fitting_count(const struct fitting *fitting); // how often it followed and stayed
// As it was after so many.
void fitting_go_back(struct fitting *fitting, uint32_t count);
