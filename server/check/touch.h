// What two groups of a case have to do with each other where they meet: how much of one lies inside
// the other, and how near they are. Millimetres.
//
// A group is the union of its shells. Triangles that another shell of the same group buries, as
// cartilage buries the bone below it, are no surface of it. Inside an open sheet is what lies
// behind it, but not past its border, and for overlaps no more than BEHIND_SHEET_MM beyond its box.
// Hollows count as filled; of a group that is inside out nothing is left, and it neither overlaps
// nor is near.
#pragma once

#include "mesh/columns.h"
#include "mesh/solid.h"

struct shell {
    struct mesh mesh;
    struct solid solid;
    struct box box;
    struct columns columns; // of a closed one
    bool *border;           // of an open sheet: vertices at its border; else NULL
};

#define SHELLS_MAX 32
#define BEHIND_SHEET_MM 20

struct touching {
    int shell_count; // 0: nothing
    struct shell shells[SHELLS_MAX];
    struct shell surface; // of several shells: what none of them buries
};

// Where one lies in the other. The depth is the largest of a place on the surface of either in the
// other: of convex bodies that overlap a little, how far they would have to part.
struct overlap {
    double volume_mm3;
    double depth_mm; // 0: they do not overlap
    vec3 place;      // of the depth, in the frame of a
};

struct gap {
    double mm;
    vec3 place; // on a, in its frame
};

// Small shells beyond SHELLS_MAX are left out. The mesh must pass mesh_validate and may go. The
// caller releases it with touching_fini, after an error too. RESULT_IO as query_create.
enum result touching_init(struct touching *touching, const struct mesh *mesh, struct error *err);
void touching_fini(struct touching *touching);

// What all shells together show.
const struct shell *touching_surface(const struct touching *touching);

// Triangles of earlier answers near by, which save time only.
struct touching_hints {
    uint32_t triangles[SHELLS_MAX + 1];
};

void touching_forget(struct touching_hints *hints); // before the first question

// Negative inside, and on the surface 0. *out_point: the nearest point of the surface.
double touching_distance(const struct touching *touching, vec3 p, struct touching_hints *hints,
                         vec3 *out_point);

// Space is divided into cubes of at most OVERLAP_LEAF_MM, or larger ones where more than
// OVERLAP_CUBES_MAX would be looked at: an overlap of any size takes a bounded time. The volume of
// a smooth overlap is good to some per cent, of a few mm³ to a third; the depth to a quarter of a
// cube's side.
#define OVERLAP_LEAF_MM 0.6
#define OVERLAP_CUBES_MAX 40000
struct overlap overlap_of(const struct touching *a, const struct touching *b, pose T_a_b);

// The least distance from a vertex of either to the other; INFINITY where one has no shell.
struct gap gap_of(const struct touching *a, const struct touching *b, pose T_a_b);
