// The last of making an S'_max: what the map of its vertices cannot promise for its triangles.
#pragma once

#include "mesh/solid.h"

#define MAXCUT_INSET_MM 0.05 // how deep in the tissue points lie that have moved

// Draws triangles of *least that stick out of the tissue in, and smooths where they are folded.
// Vertices that lie as they do in the tissue's mesh stay. False where something is left after some
// rounds: *out_restless is true for the vertices of those triangles, and false for the others.
bool maxcut_polish(const struct solid *tissue, struct mesh *least, bool *out_restless);
