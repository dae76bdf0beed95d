// Triangles of a neighbourhood in a uniform grid: which is closest to a point, which are near a
// box. Of triangles at equal distance the one added first counts. Millimetres.
#pragma once

#include "mesh/mesh.h"

// As fmin and fmax of numbers, without a call.
static inline double lower(double a, double b) {
    return a < b ? a : b;
}

static inline double higher(double a, double b) {
    return a > b ? a : b;
}

struct soup_triangle {
    vec3 corners[3];
    vec3 normal; // unit; 0 where it has no area
    uint32_t id; // the caller's
    bool mark;   // the caller's
};

// Zeroed: empty. Memory is kept from one use to the next.
struct soup {
    struct soup_triangle *at;
    uint32_t count, room;
    vec3 origin;
    double cell;
    int size[3];
    uint32_t *first, first_room; // of a cell's entries
    uint32_t *entries, entry_room;
    uint32_t *stamps, stamp_room, stamp; // of triangles that a search has seen
};

void soup_fini(struct soup *soup);
void soup_clear(struct soup *soup);
// A triangle without area is near what it is near, but never the closest.
void soup_add(struct soup *soup, const vec3 corners[3], uint32_t id, bool mark);
void soup_build(struct soup *soup); // to be called after the last one was added

// Twice the area as a vector.
static inline vec3 soup_area2(const vec3 c[3]) {
    return vec3_cross(vec3_sub(c[1], c[0]), vec3_sub(c[2], c[0]));
}

struct soup_search {
    vec3 point;
    vec3 facing; // only triangles with facing · normal >= least count
    double least;
    double within; // mm
    uint32_t hint; // an index near the answer, or MESH_NONE; it saves time only
};

struct soup_closest {
    uint32_t index;
    vec3 point;
    double distance;
    double weights[3];
    bool on_face; // neither on an edge nor in a corner
};

bool soup_closest(struct soup *soup, const struct soup_search *search, struct soup_closest *out);
void soup_closest_on(const struct soup *soup, uint32_t index, vec3 point, struct soup_closest *out);

// Calls visit for each triangle whose cells meet the box, each once.
void soup_near(struct soup *soup, struct box box, void (*visit)(void *context, uint32_t index),
               void *context);
