// Tissue minus blade: a mesh that is cut where a blade is, and nowhere else.
//
// The mesh is closed, manifold and oriented after every cut, whatever rounding does: edges share
// their crossings, caps consist of cycles, and a cut whose triangles do not link up is refused as a
// whole. A refused cut and one that removes nothing leave the mesh unchanged. The cost of a cut
// grows with the triangles that the blade touches, not with the mesh. The same calls give the same
// bits. Millimetres, in the mesh's own frame.
//
// The cut enlarges each blade, by 5e-7 mm at its nearest faces and at most 1e-5 of its size, so
// that flush bites leave no skin between them. After a cut, cleaning removes slivers and those
// vertices made by cuts that do not shape the surface; the surface sinks by less than 1e-4 mm.
//
// Ids: a vertex or triangle keeps its id while it lives. No vertex ever moves. Vertex ids of the
// original mesh are never reused; ids of triangles, and of vertices made by cuts, are reused once
// they are free.
#pragma once

#include "base/kept.h"
#include "mesh/convex.h"

#define CUT_PARTS_MAX 8

struct cut_mesh;

// mesh: closed, manifold, oriented, facing outwards; RESULT_INVALID otherwise, and the error says
// which. Vertex and triangle ids are the mesh's indices. The caller destroys *out_mesh.
enum result cut_mesh_create(const struct mesh *mesh, struct cut_mesh **out_mesh, struct error *err);
struct cut_mesh *cut_mesh_copy(const struct cut_mesh *mesh); // equal to the bit, ids and all
void cut_mesh_destroy(struct cut_mesh **mesh);               // NULL inside is fine
// Keeps a mesh, or reads one of the same origin as `whole`: equal to the bit, ids and all. NULL
// where what is read is no such mesh.
void cut_mesh_keep(struct cut_mesh **mesh, const struct cut_mesh *whole, struct kept *kept);

// Look-ups by id. Ids are below these bounds; not every id below them is alive.
uint32_t cut_mesh_vertex_bound(const struct cut_mesh *mesh);
uint32_t cut_mesh_triangle_bound(const struct cut_mesh *mesh);
uint32_t cut_mesh_triangle_count(const struct cut_mesh *mesh); // alive
bool cut_mesh_vertex_alive(const struct cut_mesh *mesh, uint32_t vertex);
bool cut_mesh_triangle_alive(const struct cut_mesh *mesh, uint32_t triangle);
vec3 cut_mesh_vertex(const struct cut_mesh *mesh, uint32_t vertex); // double precision
const uint32_t *cut_mesh_triangle(const struct cut_mesh *mesh, uint32_t triangle); // 3 vertex ids
// The number of the cut that made this surface; 0 for the original surface.
uint32_t cut_mesh_label(const struct cut_mesh *mesh, uint32_t triangle);

double cut_mesh_volume(const struct cut_mesh *mesh); // mm³, of all triangles, summed anew

// The living triangles as flat arrays, vertices and triangles in the order of their ids.
// out_vertices, out_triangles: NULL, or the ids behind, which the caller frees.
void cut_mesh_flatten(const struct cut_mesh *mesh, struct mesh *out_mesh, uint32_t **out_vertices,
                      uint32_t **out_triangles);

// A connected part of the surface made by one cut.
struct cut_patch {
    vec3 centroid; // weighted by area
    double area;   // mm²
    double extent; // largest distance of a vertex of the patch from the centroid
};

// A part that came off and is no longer in the mesh.
struct cut_piece {
    double volume; // mm³
    vec3 centroid; // of the volume
    struct mesh mesh;
};

// What a cut did. Ids are ascending and each once.
struct cut_change {
    uint32_t number;      // of the cut: 1 for the first that changed the mesh
    double removed_mm3;   // by the blade and the cleaning after it; without pieces
    double volume_mm3;    // of the mesh after it
    int retries;          // with the blade larger by 2e-6 mm each time, all parts together
    uint32_t freed_count; // triangles that are gone, their ids not in use after the cut
    uint32_t *freed;
    uint32_t made_count; // triangles that are new or have other corners than before
    uint32_t *made;
    uint32_t vertex_count; // vertices that are new
    uint32_t *vertices;
    int patch_count;
    struct cut_patch *patches;
    int piece_count; // all parts but the largest, each with its cavities
    struct cut_piece *pieces;
};

void cut_change_fini(struct cut_change *change); // a zeroed change is fine; it is zeroed

enum cut_outcome {
    CUT_CHANGED,
    CUT_NOTHING, // the blade does not touch the tissue, or takes less than 1e-4 mm³
    CUT_REFUSED  // nothing changed; the error says why
};

// Removes the union of convex parts from the mesh. The parts may overlap or touch. A cut that would
// remove the whole mesh is refused. CUT_CHANGED sets *out_change, which the caller releases.
enum cut_outcome cut_apply(struct cut_mesh *mesh, const struct convex *parts, int part_count,
                           struct cut_change *out_change, struct error *err);
