// Triangles of a neighbourhood in a tree of boxes: which is closest to a point, which are near a
// box. Of triangles at equal distance the one added first counts. Millimetres.
#pragma once

#include "base/extremes.h"
#include "mesh/eights.h"
#include "mesh/mesh.h"

struct soup_triangle {
    vec3 corners[3];
    vec3 normal;  // unit; 0 where it has no area
    double area2; // twice the area
    uint32_t id;  // the caller's
    bool mark;    // the caller's
};

// The plane of a triangle, and a sphere around it: what a search asks first.
struct soup_plane {
    vec3 normal; // NaN where the triangle is never the closest
    double offset;
    vec3 middle;
    double radius;
};

// Eight boxes around triangles or around other eights, from the soup's origin on.
struct soup_boxes {
    float middle[3][EIGHT], half[3][EIGHT];
    int32_t faces[EIGHT]; // of a cube around them, those that normals look through; 0: no box
};

#define SOUP_LEVELS_MAX 10 // 8^10 triangles

// Zeroed: empty. Memory is kept from one use to the next. Box i of a level, in block i/8 of it,
// holds boxes 8i to 8i + 7 of the level below; those of level 0 hold one triangle each. The top
// level has one block.
struct soup {
    struct soup_triangle *at;
    uint32_t count, room;
    struct soup_plane *planes; // by triangle
    uint32_t *lanes;           // by triangle: its box of level 0
    struct eights_item *order; // by box of level 0: its triangle
    struct soup_boxes *blocks; // of level 0 first
    float *middles;            // scratch of soup_build
    uint32_t plane_room, lane_room, order_room, block_room, middle_room;
    vec3 origin;
    double reach; // largest coordinate from it: what single precision is relative to
    int level_count;
    uint32_t starts[SOUP_LEVELS_MAX], counts[SOUP_LEVELS_MAX]; // first block, boxes of a level
};

void soup_fini(struct soup *soup);
void soup_clear(struct soup *soup);
// A triangle without area is near what it is near, but never the closest.
void soup_add(struct soup *soup, const vec3 corners[3], uint32_t id, bool mark);
void soup_build(struct soup *soup); // to be called after the last one was added
// Puts a triangle elsewhere. After the last one soup_settle is due.
void soup_move(struct soup *soup, uint32_t index, const vec3 corners[3]);
void soup_settle(struct soup *soup);

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

bool soup_closest(const struct soup *soup, const struct soup_search *search,
                  struct soup_closest *out);
void soup_closest_on(const struct soup *soup, uint32_t index, vec3 point, struct soup_closest *out);

// The same among some triangles; their order makes no difference. Of the search no hint is asked.
bool soup_closest_among(const struct soup *soup, const struct soup_search *search,
                        const uint32_t *indices, uint32_t count, struct soup_closest *out);

// Calls visit once for each triangle whose box meets the box, and for some beside it.
void soup_near(const struct soup *soup, struct box box,
               void (*visit)(void *context, uint32_t index), void *context);
// The same for those with facing · normal >= least, which have an area.
void soup_near_facing(const struct soup *soup, struct box box, vec3 facing, double least,
                      void (*visit)(void *context, uint32_t index), void *context);
