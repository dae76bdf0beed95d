// The inside of a match_surface.
#pragma once

#include "match/match.h"

// The side of a triangle that lies opposite one of its corners, counter-clockwise.
struct opposite {
    uint32_t from, to;
};

struct match_surface {
    uint32_t vertex_count, triangle_count;
    uint32_t *triangles;
    vec3 *start;     // S'
    vec3 *way;       // S'_max − S'
    uint32_t *first; // the fan of vertex v: opposites[first[v]] to opposites[first[v + 1] - 1]
    struct opposite *opposites;
    double spacing; // mean length of the sides
    double volume, least;
};

// Inside a closed surface of these triangles, with its vertices elsewhere.
double surface_volume(const struct match_surface *surface, const vec3 *positions);
