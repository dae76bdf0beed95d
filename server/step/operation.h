// The tissue of one session as cuts change it: the cut meshes, the blends that match them, and the
// quality of the resection. It runs the jobs that steps ask for, beside the steps.
//
// An operation belongs to one thread at a time. The same jobs in the same order give the same bits.
#pragma once

#include "match/match.h"
#include "step/job.h"
#include "step/scene.h"

struct operation;

// The scene must outlive it.
struct operation *operation_create(const struct scene *scene);
void operation_destroy(struct operation **operation); // NULL inside is fine

// Runs a job. It takes milliseconds and allocates. The caller destroys the result.
//
// Strokes are undone from the last one backwards, until all tissue is as it was at the start or
// when it was last restored. A tissue's state before a stroke is found by making the cuts before it
// again, from the nearest state that was kept: states are kept between strokes, the newest two that
// are at least 32 cuts apart.
struct job_result *operation_run(struct operation *operation, const struct job *job);

const struct cut_mesh *operation_mesh(const struct operation *operation, int tissue);
const struct match *operation_match(const struct operation *operation, int tissue); // or NULL
const struct tissue_figures *operation_figures(const struct operation *operation, int tissue);
