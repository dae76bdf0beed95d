// Makes the mesh_delta that stations get for the change of a mesh by a cut. The delta owns all its
// arrays. The feed sets base, number and hash. Positions become floats.
#pragma once

#include "cut/cut.h"
#include "wire/tissue.h"

void tissue_delta_whole(const struct cut_mesh *mesh, struct mesh_delta *out_delta);

// mesh: after the change.
void tissue_delta_of_change(const struct cut_mesh *mesh, const struct cut_change *change,
                            struct mesh_delta *out_delta);

// The delta has no pieces yet.
void tissue_delta_add_pieces(const struct cut_change *change, struct mesh_delta *out_delta);

// All differences from the stations' mesh to another mesh of the same origin.
void tissue_delta_between(const struct tissue *before, const struct cut_mesh *mesh,
                          struct mesh_delta *out_delta);
