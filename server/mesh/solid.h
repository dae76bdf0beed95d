// A closed mesh that knows its inside: signed distances by the pseudo-normals of the closest
// feature (Bærentzen and Aanæs 2005). Points beside its box are outside.
#pragma once

#include "mesh/query.h"

struct solid {
    const struct mesh *mesh;
    struct box box;
    struct query *query;
    vec3 *face_normals;   // unit
    vec3 *vertex_normals; // weighted by angle
    uint32_t *neighbours; // 3 * triangle_count: across the edge from corner i, or MESH_NONE
};

// The mesh must outlive the solid and pass mesh_validate. The caller releases it with solid_fini,
// after an error too.
enum result solid_init(struct solid *solid, const struct mesh *mesh, struct error *err);
void solid_fini(struct solid *solid);

// Of p, whose closest point is known: negative inside.
double solid_signed(const struct solid *solid, vec3 p, const struct closest *closest);

// Negative inside. hint: the triangle of an earlier answer or MESH_NONE; it becomes this one's.
double solid_distance(const struct solid *solid, vec3 p, uint32_t *hint);

// The deepest that the segment lies inside (0: nowhere), found to within a step of 0.5 mm along it.
double solid_depth(const struct solid *solid, vec3 from, vec3 to);
