// A knee of scene/bodies.h with poses, and what properties of the warp ask of it.
#pragma once

#include "random.h"
#include "scene/bodies.h"

// Five surfaces on three bodies, each somewhere near its place, each corrected a little; the last
// one bridges from its body to another.
struct world {
    struct bodies bodies;
    float *share;
    pose B[3], M[3];
    struct warp_scene scene;
};

// Must not move in memory.
void world_create(struct world *w, struct random *r, bool corrected);
void world_fini(struct world *w);

// Other poses, and corrections or none.
void world_place(struct world *w, struct random *r, bool corrected);
pose world_small_pose(struct random *r, double angle_rad, double length_mm);

vec3 world_somewhere(struct random *r); // on the path between the surfaces
vec3 world_point_on(const struct world *w, int surface, struct random *r);
double world_clearance(const struct world *w, int surface, vec3 y); // to all other surfaces

// Without memory.
struct warp world_warp(const struct warp_scene *scene, const struct field *field, vec3 y);
struct closest world_contact(const struct warp_scene *scene, int surface, vec3 y);
