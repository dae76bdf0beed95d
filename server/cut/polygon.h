// A polygon with holes into triangles, by cutting ears off.
//
// Whatever the polygon looks like, a ring of n vertices becomes n - 2 triangles whose sides pair up
// inside it; where rounding has bent it, they may be flat or overlap by as much. No side of a
// triangle is drawn twice, in whatever polygon of the same table.
#pragma once

#include "base/pose.h"
#include "cut/sides.h"

struct polygon_filler; // memory that is kept from one polygon to the next

struct polygon_filler *polygon_create(void);
void polygon_destroy(struct polygon_filler **filler); // *filler becomes NULL

// A ring's sides are drawn: no diagonal may be one of them. `drawn` holds sides from the lower
// vertex, and needs room for twice the vertices of all rings and four for each ring.
void polygon_draw_ring(struct side_table *drawn, const uint32_t *vertices, uint32_t count);

// In the plane through `origin`, seen from where `normal` (of any length) points to.
void polygon_begin(struct polygon_filler *filler, struct side_table *drawn, vec3 normal,
                   vec3 origin);

// Of at least three vertices, which are indices of `points`. The first ring is the border, counter-
// clockwise; the others are holes, clockwise. All rings have been drawn.
void polygon_add_ring(struct polygon_filler *filler, const vec3 *points, const uint32_t *vertices,
                      uint32_t count);

// With one ring at least. NULL, and three vertices for each triangle, which stay until the polygon
// begins anew; or why it cannot be filled.
const char *polygon_fill(struct polygon_filler *filler, const uint32_t **out_corners,
                         uint32_t *out_count);
