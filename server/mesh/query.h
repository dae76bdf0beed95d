// The closest point of a static mesh.
//
// Exact to double precision for the mesh's own (float) vertices; equal distances go to the lower
// triangle id, so the answer depends neither on the hint nor on the order of traversal. Any number
// of threads may ask one query at once. Asking allocates nothing.
#pragma once

#include "mesh/mesh.h"

struct query;

enum feature { FEATURE_FACE, FEATURE_EDGE, FEATURE_VERTEX };

struct closest {
    double distance; // mm, >= 0
    vec3 point;      // on the surface, in the mesh's frame
    uint32_t triangle;
    double weights[3]; // barycentric: point = Σ weights[i] * corner i
    enum feature feature;
    int corner; // FEATURE_EDGE: from this corner to the next; FEATURE_VERTEX: this corner
};

// The query keeps a pointer to the mesh, which must outlive it unchanged and pass mesh_validate.
// RESULT_INVALID: it has no triangles. The caller destroys it.
enum result query_create(const struct mesh *mesh, struct query **out_query, struct error *err);
void query_destroy(struct query **query); // NULL inside is fine; *query becomes NULL

// Finds the closest point to p not farther than max_distance (INFINITY for any); false where there
// is none. hint: the triangle of an earlier answer near p, or MESH_NONE; it saves time only.
// p must be finite.
bool query_closest(const struct query *query, vec3 p, double max_distance, uint32_t hint,
                   struct closest *out_closest);

// What one search tells about places around its own. Zero: nothing.
#define QUERY_NEAR_MAX 12
struct query_near {
    uint64_t query; // whose search it was
    vec3 from;
    double clear; // what is in none of the clusters is farther than that from there
    uint32_t count;
    uint32_t clusters[QUERY_NEAR_MAX];
    float away[QUERY_NEAR_MAX]; // from there, at least; the nearest first
};

// The answer of query_closest; while p moves little, what *near tells saves time.
bool query_closest_near(const struct query *query, vec3 p, double max_distance, uint32_t hint,
                        struct query_near *near, struct closest *out_closest);

// The closest point of one triangle of a mesh: the same arithmetic, without a search.
void closest_on_triangle(const struct mesh *mesh, uint32_t triangle, vec3 p,
                         struct closest *out_closest);
