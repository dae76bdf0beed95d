// Repairs a surface from outside for use in a case, as far as that is safe, and reports the rest.
//
// Nothing is moved but the corners of a triangle soup that are welded. In this order:
//   1. Vertices of open edges that lie in one place become one. Closed surfaces that touch stay
//      apart.
//   2. Triangles with a repeated corner, and all but the first of those with the same three
//      corners, are removed; both sides of a wall without thickness, where the surface around it
//      goes on without it. A triangle without height stays: a hole would be worse.
//   3. Fins and hairs are removed: sheets of less than 1 mm² and 1 % of the area that hang on an
//   edge
//      of other triangles and end freely. What carries them stays.
//   4. Neighbours are made to run the same way round. Where an even number of triangles meets in an
//      edge, inside and outside alternate around it, and those that bound one solid stay together.
//   5. A vertex where several sheets touch is split: one copy for each.
//   6. Islands are removed: components with less than a share of the whole area.
//   7. Closed components face outwards; those inside of another one (voids) inwards.
//   8. Vertices that no triangle uses are dropped.
// Open edges, handles, edges with an odd number of triangles, and surfaces with one side only stay
// as they are and show in report.after.
#pragma once

#include "mesh/topology.h"

#define REPAIR_ISLANDS_MAX 8

struct repair_settings {
    double weld_mm;      // open vertices as near as this become one; 0: in the same place
    double island_share; // of the whole area
};

struct repair_island {
    uint32_t triangles;
    double area_mm2;
    vec3 centre; // of its box
};

// What happened, or remains, at places.
enum repair_kind {
    REPAIR_WELDED,    // vertices, where they were
    REPAIR_REPEATED,  // triangles with a repeated corner
    REPAIR_DUPLICATE, // triangles, those of walls too
    REPAIR_WALL,      // triangles
    REPAIR_TURNED,    // triangles
    REPAIR_SPLIT,     // vertices
    REPAIR_VOID,      // components inside of another one
    REPAIR_FLAT,      // triangles
    REPAIR_OPEN,      // edges of one triangle that are left
    REPAIR_CROWDED,   // edges of more than two triangles that are left
    REPAIR_KINDS
};

struct repair_place {
    bool somewhere; // false: the box has no meaning
    struct box box; // around all of them
};

struct repair_report {
    struct topology before, after;
    struct repair_place places[REPAIR_KINDS];
    uint32_t vertices_before, triangles_before;
    uint32_t repeated_corners;    // triangles removed; those that the reader left out have no place
    uint32_t duplicate_triangles; // removed
    uint32_t wall_triangles;      // removed: both sides
    uint32_t fin_count, fin_triangles;             // removed
    struct repair_island fins[REPAIR_ISLANDS_MAX]; // the first ones
    uint32_t flat_triangles;                       // left: lower than 1e-6 mm
    uint32_t welded_vertices;                      // taken into another one
    double welded_mm;                              // the farthest that a corner was moved
    uint32_t turned_triangles;
    uint32_t split_vertices; // copies made
    uint32_t voids;          // closed components inside of another one
    uint32_t island_count, island_triangles;
    double island_area_mm2, area_mm2;                 // removed; of the whole before
    struct repair_island islands[REPAIR_ISLANDS_MAX]; // the largest ones, the largest first
};

// In place; both arrays may be replaced. The mesh must pass mesh_validate but for repeated corners.
// False where no triangle is left, which is only so where all have repeated corners. The same mesh
// gives the same result. O(n log n) but for step 7, which is O(n) for each component left.
bool repair_mesh(struct mesh *mesh, const struct repair_settings *settings,
                 struct repair_report *out_report);

// Of a mesh that was changed since: after, voids, flat_triangles and the places of what remains.
void repair_look(const struct mesh *mesh, struct repair_report *report);
