// Pairs of triangles that run through one another.
#pragma once

#include "cutting/surface.h"

// Pairs of which one has an edge that pierces the inside of the other, edges that meet the other in
// a shared corner not counted. What only touches does not count.
int snapshot_crossings(const struct snapshot *surface);
