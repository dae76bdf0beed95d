// Tissue, blades and bites for the tests of cutting.
#pragma once

#include "cut/cut.h"
#include "mesh/topology.h"
#include "random.h"

struct cut_mesh *cut_mesh_of(struct mesh *shape); // the shape is released
struct cut_mesh *cube(double half);
struct cut_mesh *sphere(double radius, int n);

struct convex box(vec3 low, vec3 high);
struct convex random_convex(struct random *r, vec3 centre, double size);
// Near a random place of the surface.
struct convex random_bite(struct random *r, const struct cut_mesh *mesh, double size);

struct cut_change cut(struct cut_mesh *mesh, struct convex blade); // which changes it

// Asserts that the mesh is closed, manifold and oriented, and its flat copy one with it.
struct topology sound_topology(const struct cut_mesh *mesh);
double area_of(const struct cut_mesh *mesh);

// All that everybody can see of a mesh.
struct picture {
    uint32_t vertex_bound, triangle_bound;
    bool *vertex_alive;
    vec3 *points;      // 0 where not alive
    uint32_t *corners; // MESH_NONE where not alive
    uint32_t *labels;
};

struct picture take_picture(const struct cut_mesh *mesh);
void drop_picture(struct picture *picture);
void assert_same(const struct cut_mesh *a, const struct cut_mesh *b); // to the bit

bool contains(const uint32_t *ids, uint32_t count, uint32_t id);
