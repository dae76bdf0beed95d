// Embree's point query as its manual has it: a triangle a primitive, measured in single precision
// by the callback. What mesh/query.h is compared with.
#pragma once

#include "mesh/mesh.h"

struct plain_query;

// Keeps a pointer to the mesh. The caller destroys it.
struct plain_query *plain_query_create(const struct mesh *mesh);
void plain_query_destroy(struct plain_query **query);

// The distance from p to the mesh, INFINITY where it is not within reach.
double plain_query_distance(const struct plain_query *query, vec3 p, double reach_mm);
