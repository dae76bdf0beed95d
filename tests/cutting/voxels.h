// Exactly degenerate cuts whose outcome can be counted: cubes with integer corners, minus boxes
// whose corners are multiples of 0.5 mm, among them boxes that lie flush beside the last one.
#pragma once

#include "cutting/trial.h"
#include "random.h"

struct voxel_run {
    int cuts; // that changed the mesh
    int pieces, retries;
    double volume_error; // mm³, the largest after any cut, of the mesh or of a piece
    double area_error;   // mm², the largest after any cut: a membrane of no volume has an area
    const char *fault;   // what is wrong beyond that, NULL where nothing is
};

// A sequence of `bites` boxes; cubes of 4, 6 or 8 mm, with sides of two triangles or of a lattice.
struct voxel_run voxel_sequence(uint64_t seed, int bites);

// A cube centred on the origin, each side n x n squares of two triangles. Released with mesh_fini.
void lattice_cube(struct mesh *out, double half, int n);
