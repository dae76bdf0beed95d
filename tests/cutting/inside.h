// Which points lie inside: the oracles of what a cut took. Nothing here knows how a cut is made.
#pragma once

#include "cutting/surface.h"
#include "random.h"

// ---- points in a closed surface, fast: crossings of a line along z ----

struct locator;

// The surface must live as long. The caller destroys it.
struct locator *locator_create(const struct snapshot *surface);
void locator_destroy(struct locator **locator);
bool locator_inside(const struct locator *locator, vec3 p);

// ---- the same, slow and sure: the winding number ----

bool winding_inside(const struct snapshot *surface, vec3 p);

// ---- volumes by random points ----

struct estimate {
    double volume, sigma; // mm³
};

bool parts_contain(const struct convex *parts, int count, vec3 p);
struct box parts_box(const struct convex *parts, int count);
vec3 point_in_box(struct random *random, struct box box);

// What the parts have in common with the inside of a surface.
struct estimate estimate_common(const struct locator *locator, const struct convex *parts,
                                int count, int points, struct random *random);

// Distances to what a membership turns at: the surface, slow, and the nearest plane of a part.
double snapshot_distance(const struct snapshot *surface, vec3 p);
double parts_clearance(const struct convex *parts, int count, vec3 p);
