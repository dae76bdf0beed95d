// The tissue of one session as cuts change it: the cut meshes, the touched surfaces that follow
// them, and the quality of the resection. It runs the jobs that steps ask for, beside the steps.
//
// An operation belongs to one thread at a time. The same jobs in the same order give the same bits.
#pragma once

#include "cut/cut.h"
#include "step/job.h"
#include "step/scene.h"

struct operation;

// The scene must outlive it. rules, instruments: of the session (step/settings.h).
struct operation *operation_create(const struct scene *scene, int rules,
                                   const struct instruments *instruments);
void operation_destroy(struct operation **operation); // NULL inside is fine

// Keeps an operation by RULES_NEWEST, or reads it into a new one of the same scene, rules and
// instruments, from which it then does not differ by a bit. What it kept to undo faster is left
// out. Where what is read is bad, the operation can only be destroyed.
void operation_keep(struct operation *operation, struct kept *kept);

// Runs a job. It takes milliseconds and allocates. The caller destroys the result.
//
// Undo goes backwards from the last stroke, to the start or to the last restore. To find a tissue's
// state before a stroke, the operation makes the cuts before it again, from the nearest state that
// it kept. It keeps the two newest states between strokes that are at least 32 cuts apart.
struct job_result *operation_run(struct operation *operation, const struct job *job);

// Puts a touched surface from elsewhere in the place of the one that the match found: that of a
// recorded session, whose match may have been another one. `result` is that of the last job; its
// touch, hash and figures become those of the other surface, and the next cut begins from it.
// Returns the largest distance between the two, in mm; 0: they are equal.
//
// Only if it is allowed: a cut changed tissue whose touch is fitted, and which has the vertices.
bool operation_allows_touch(const struct operation *operation, const struct job_result *result,
                            const struct touch_change *touch);
double operation_take_touch(struct operation *operation, struct job_result *result,
                            const struct touch_change *touch);

// Until a job comes, and after it was restored: the tissue is the scene's own.
bool operation_is_whole(const struct operation *operation, int tissue);
const struct cut_mesh *operation_mesh(const struct operation *operation, int tissue);
// The touched surface: 0 where the group has no S'_max and never gives way; else the width of a
// touch_change, the values of a vertex, and the vertex in S''.
int operation_touch_width(const struct operation *operation, int tissue);
void operation_touch(const struct operation *operation, int tissue, uint32_t vertex,
                     double out_values[3]);
vec3 operation_touched(const struct operation *operation, int tissue, uint32_t vertex);
// How far S'' lies from the mesh at each vertex, by its id; 0 for those that are not alive
// (match/mismatch.h). Where the group never gives way, S'' is S'. It takes milliseconds and
// allocates. out_mm: as many as cut_mesh_vertex_bound.
void operation_mismatch(const struct operation *operation, int tissue, double *out_mm);
const struct tissue_figures *operation_figures(const struct operation *operation, int tissue);
