// What the displacements of tissue go through while cuts are eased in: anything between S' and
// S'_max, the most that is asked of the touched surface.
#pragma once

#include "step/scene.h"

// The field of S'_max; keeps to the scene, which must outlive it.
struct eased;

// NULL where no group of the case can give way to a cut.
struct eased *eased_create(const struct scene *scene);
void eased_destroy(struct eased **eased); // NULL inside is fine

// At a pose of the joint: every surface where the greatest resection puts it, and only what lies
// between that and S', without corrections, for moved_init. Both last as long as the stance.
void eased_stand(const struct eased *eased, const struct scene_stance *stance,
                 struct warp_scene *out_aimed, struct warp_scene *out_changed);
