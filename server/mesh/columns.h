// A closed mesh as columns: where the vertical lines of a square lattice enter and leave it.
#pragma once

#include "mesh/mesh.h"

// Column (i, j) stands at x + (i0 + i) step, y + (j0 + j) step. It crosses the mesh at
// heights[first[c]] to heights[first[c + 1] - 1], rising, c = j nx + i: inside between each even
// one and the next.
struct columns {
    double x, y, step;
    int i0, j0, nx, ny;
    size_t *first;
    double *heights;
};

// The lattice lies evenly over the mesh's box: that of a mirrored mesh is mirrored.
// points: the mesh's vertices in the frame whose z the columns follow. A line through an edge
// counts for one of its triangles only, so that a closed mesh is always left as often as entered.
// The caller releases it with columns_fini.
void columns_init(struct columns *columns, const struct mesh *mesh, const vec3 *points,
                  double step);
// The same on the lattice of another box, of the columns over a part of it alone. i0 and j0 are 0
// where the part is the whole. Nothing is over a part that is empty (min above max).
void columns_init_over(struct columns *columns, const struct mesh *mesh, const vec3 *points,
                       double step, struct box lattice, struct box part);
void columns_fini(struct columns *columns);
