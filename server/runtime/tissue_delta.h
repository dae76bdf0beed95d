// What a cut did to a mesh, as the change that stations are told. All arrays are the delta's own;
// base, number and hash are the feed's to set. Positions become floats.
#pragma once

#include "cut/cut.h"
#include "wire/tissue.h"

void tissue_delta_whole(const struct cut_mesh *mesh, struct mesh_delta *out_delta);

// mesh: after the change.
void tissue_delta_of_change(const struct cut_mesh *mesh, const struct cut_change *change,
                            struct mesh_delta *out_delta);

// The delta has no pieces yet.
void tissue_delta_add_pieces(const struct cut_change *change, struct mesh_delta *out_delta);

// From what stations have to any mesh of the same origin: all that differs.
void tissue_delta_between(const struct tissue *before, const struct cut_mesh *mesh,
                          struct mesh_delta *out_delta);
