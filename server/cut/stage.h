// One attempt to remove one convex part from the mesh, in stages. Until link.c has found that all
// triangles fit together, the stages only read the mesh and take ids for new vertices.
//
//     near    triangles and vertices near the blade, and on which side of each plane they lie
//     trace   where edges enter and leave the blade, and the arcs that triangles draw on its faces
//     wind    which parts of the blade's own edges lie inside the mesh, and the loops on its faces
//     fill    polygons with holes into triangles
//     link    neighbours of the new triangles; then the mesh changes
//
// A function that returns false refuses the cut; stage->refusal says why.
#pragma once

#include "cut/cut_mesh.h"
#include "cut/sides.h"

// An original vertex of the mesh: bit i of `outside` where it is outside plane i.
struct near_vertex {
    uint32_t id;
    uint64_t outside;
};

struct edge_crossing {
    uint32_t vertex; // MESH_NONE: there is none
    int plane;
};

// Of a mesh edge, in the direction of the lower of its two sides.
struct edge_trace {
    struct edge_crossing enter, leave;
};

struct near_triangle {
    uint32_t id;
    uint32_t corners[3]; // near vertices
    uint32_t edges[3];   // edge traces
    bool goes;
};

// Where an edge of the blade goes through a triangle: sign is 1 into the mesh, -1 out of it, going
// from the edge's first end to its second.
struct piercing {
    int edge, sign;
    double t; // 0 to 1 along the edge
    uint32_t vertex;
};

// A directed piece of the border of new surface on a face of the blade.
struct segment {
    int face;
    uint32_t from, to;
};

// A polygon with holes, seen from the side that `normal` points to: rings of vertices, the first
// one counter-clockwise around it, holes clockwise.
struct region {
    uint32_t first_ring, ring_count;
    uint32_t label;
    vec3 normal; // of any length
};

struct vertex_ring {
    uint32_t first, count; // of ring_vertices
};

// A ring on a face of the blade before it is known what it belongs to.
struct face_loop {
    struct vertex_ring ring;
    double area;
    uint32_t owner; // of a hole: the loop that it is a hole of; itself where there is none
};

struct new_triangle {
    uint32_t corners[3];
    uint32_t label;
};

// The side that runs back beside one of a new triangle.
struct back_side {
    uint32_t side;
    bool living; // of a triangle that stays; otherwise of a new one
};

struct stage {
    struct convex blade;                                        // grown by a hair
    int16_t edge_between[CONVEX_PLANES_MAX][CONVEX_PLANES_MAX]; // of two faces; -1: none
    uint64_t beside[CONVEX_PLANES_MAX];                         // faces that share an edge
    uint32_t number;                                            // of the cut: new surface's label
    const char *refusal;

    struct stamped_set slots; // of vertices or triangles, as each step needs
    struct ids candidates;
    struct near_vertex *vertices;
    double *values; // signed distances from the planes, plane_count for each near vertex
    struct near_triangle *triangles;
    struct edge_trace *edges;
    uint32_t vertex_count, vertex_room, value_room, triangle_count, triangle_room;
    uint32_t edge_count, edge_room;

    struct ids taken;   // vertices
    struct ids pierced; // by the arc at work
    struct piercing *piercings;
    struct segment *segments;
    uint32_t piercing_count, piercing_room, segment_count, segment_room;

    struct region *regions;
    struct vertex_ring *rings;
    struct ids ring_vertices;
    struct face_loop *loops; // of the face at work
    uint32_t region_count, region_room, ring_count, ring_room, loop_room;

    struct new_triangle *made;
    struct back_side *backs; // of each side of `made`
    uint32_t made_count, made_room, back_room;
    struct ids made_ids;     // once they are in the mesh
    struct side_table drawn; // sides of polygons and diagonals, from the lower vertex
    struct side_table sides; // of new triangles, and those that look at a triangle that goes
    struct polygon_filler *filler;
    double removed_mm3;
};

struct stage *stage_create(void);
void stage_destroy(struct stage **stage);

#define CUT_ATTEMPTS 9

// seed: of the hair by which the blade grows; attempt: 0 to CUT_ATTEMPTS - 1, by more each time.
void stage_begin(struct stage *stage, const struct convex *part, uint64_t seed, int attempt);

bool stage_refuse(struct stage *stage, const char *why); // false
uint32_t stage_take_vertex(struct cut_mesh *mesh, struct stage *stage, vec3 point);
void stage_add_segment(struct stage *stage, int face, uint32_t from, uint32_t to);
void stage_add_piercing(struct stage *stage, struct piercing piercing);
// Rings are appended to the last region.
void stage_add_region(struct stage *stage, uint32_t label, vec3 normal);
void stage_begin_ring(struct stage *stage);
void stage_add_to_ring(struct stage *stage, uint32_t vertex);

// The triangles that may meet the box, and with a blade that one too; each once.
void near_collect(const struct cut_mesh *mesh, struct box box, const struct convex *blade,
                  struct stamped_set *seen, struct ids *out);
void near_gather(struct cut_mesh *mesh, struct stage *stage);
void trace_triangles(struct cut_mesh *mesh, struct stage *stage);
bool wind_blade(struct cut_mesh *mesh, struct stage *stage);
bool cap_faces(struct cut_mesh *mesh, struct stage *stage);
bool fill_regions(const struct cut_mesh *mesh, struct stage *stage);
bool link_triangles(struct cut_mesh *mesh, struct stage *stage);
void link_commit(struct cut_mesh *mesh, struct stage *stage); // the mesh changes
