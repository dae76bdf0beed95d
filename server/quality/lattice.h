// Samples in a tissue, in columns that stand along the view's third axis, 0.25 mm apart in each
// direction. Millimetres.
#pragma once

#include "mesh/convex.h"
#include "quality/view.h"

#define LATTICE_MM 0.25

// Samples first to first + count - 1, the lowest of them `low` steps above the lattice's origin.
struct lattice_column {
    uint32_t first;
    int32_t low;
    int32_t count;
};

struct lattice {
    struct plan_view view;
    vec3 origin;    // in the view: where the lowest sample of the first column would be
    int wide, deep; // columns along x and y; that at (i, k) is columns[k * wide + i]
    struct lattice_column *columns;
    uint32_t sample_count;
};

// Columns as high as the mesh is there. The caller releases it with lattice_fini.
void lattice_init(struct lattice *lattice, const struct plan_view *view, const struct mesh *mesh);
void lattice_fini(struct lattice *lattice);

static inline int lattice_column_count(const struct lattice *lattice) {
    return lattice->wide * lattice->deep;
}

vec3 lattice_column_place(const struct lattice *lattice, int column); // z: 0

// The column that contains a point of the view, or -1.
int lattice_column_at(const struct lattice *lattice, double x, double y);

// Called for each run of samples of one column that are inside: first to end - 1.
typedef void lattice_visit(void *context, int column, uint32_t first, uint32_t end);

void lattice_in_convex(const struct lattice *lattice, const struct convex *convex,
                       lattice_visit *visit, void *context);

// The mesh is closed. windings: one for each sample, all 0 before and after.
void lattice_in_mesh(const struct lattice *lattice, const struct mesh *mesh, int8_t *windings,
                     lattice_visit *visit, void *context);
