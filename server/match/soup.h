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

// What a search asks first of a triangle, in one line of the cache.
struct soup_bound {
    vec3 normal;           // NaN where the triangle is never the closest
    double offset;         // of its plane
    float low[3], high[3]; // its box, or a hair more
    uint32_t stamp;        // of the last search that has seen it
};

// A face says through which one of a cube around it a normal looks.
struct soup_entry {
    uint32_t triangle;
    uint8_t face;
};

struct soup_cells {
    uint16_t low[3], high[3];
};

// Zeroed: empty. Memory is kept from one use to the next.
struct soup {
    struct soup_triangle *at;
    uint32_t count, room;
    vec3 origin;
    double cell, per_mm; // a cell's side, and cells in a mm
    int size[3];
    uint32_t *first, first_room; // of a cell's entries
    uint8_t *faces;              // of a cell: those of its entries
    struct soup_entry *entries;
    uint32_t entry_room, face_room;
    struct soup_bound *bounds; // by triangle, as what follows
    struct soup_cells *cells;
    struct box *rooms; // a marked triangle lies in its cells while its box is in this
    uint32_t bound_room, cell_room, room_room, stamp;
};

void soup_fini(struct soup *soup);
void soup_clear(struct soup *soup);
// A triangle without area is near what it is near, but never the closest.
void soup_add(struct soup *soup, const vec3 corners[3], uint32_t id, bool mark);
void soup_build(struct soup *soup); // to be called after the last one was added
// Puts a marked triangle elsewhere. False: it has left its cells, and soup_build is due.
bool soup_move(struct soup *soup, uint32_t index, const vec3 corners[3]);

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

// False only where no triangle near the box has facing · normal >= least. The soup is not empty.
bool soup_may_face(const struct soup *soup, struct box box, vec3 facing, double least);

// Calls visit for each triangle whose cells meet the box, each once.
void soup_near(struct soup *soup, struct box box, void (*visit)(void *context, uint32_t index),
               void *context);
