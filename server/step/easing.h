// Eases what a job changed of the touched surface into the displacements that the warp reads, so
// that a tip near the cut feels no jump. For session.c only.
#pragma once

#include "step/operation.h"
#include "step/scene_parts.h"

// One cuttable group of one session. It shares what the scene has until a job changes the touch.
struct easing;

// Displacements start at the static ones, those of the scene. The scene must outlive it.
// rules: of the session (step/settings.h).
struct easing *easing_create(const struct scene *scene, int tissue, const struct field *field,
                             int rules);
void easing_destroy(struct easing **easing); // NULL inside is fine

// 3 * vertex_count: S'' − S as far as it is eased in. These three addresses change with the first
// touch that easing_aim gets.
const float *easing_displacement(const struct easing *easing);
// The mean of these displacements, always up to date. NULL if the field is not smooth or the group
// bridges two bones.
const struct surface_mean *easing_mean(const struct easing *easing);
// The integral of these displacements, always up to date. NULL if the field is not integral or the
// group bridges two bones.
const struct surface_integral *easing_integral(const struct easing *easing);

void easing_restore(struct easing *easing); // at once to the static displacements

// Gives the first touch to come the memory that it needs. For the thread that runs the jobs, before
// the first one that changes the touch lands.
void easing_make_room(struct easing *easing);

// Sets what a job changed as the new target. Allocates nothing after easing_make_room.
void easing_aim(struct easing *easing, const struct touch_change *touch);

// Keeps what is not eased in yet, or reads it into a new easing. Its target is the touched surface
// of the operation; who writes needs none.
void easing_keep(struct easing *easing, const struct operation *operation, int tissue,
                 struct kept *kept);
uint32_t easing_pending_count(const struct easing *easing); // vertices

bool easing_active(const struct easing *easing);

// The largest remaining change, in mm, of the displacement at a tip that is at p, in the group's
// frame, and closest to this triangle; 0 for MESH_NONE. With a mean the whole surface counts.
double easing_rest_mm(const struct easing *easing, vec3 p, uint32_t triangle);

// Applies this share, 0 to 1, of the remaining change. Only where it is active.
void easing_advance(struct easing *easing, double share);
