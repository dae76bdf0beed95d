// Cavities: closed parts of the surface that face inwards.
#pragma once

#include "cut/cut_mesh.h"

struct cavities {
    struct ids triangles;
    struct ids ends; // of each cavity's triangles; they begin where the last one's end
};

// All that there are. Walks over what cuts have made, and over the whole of a mesh that was in
// several parts. seen: scratch.
void hollow_find(const struct cut_mesh *mesh, struct stamped_set *seen, struct cavities *out);
void cavities_fini(struct cavities *cavities);

// Appends the triangles of those inside the closed surface that `triangles` are. seen: scratch.
void hollow_append(const struct cut_mesh *mesh, const struct cavities *cavities,
                   struct stamped_set *seen, struct ids *triangles);
