// The search of query.c for one CPU level: WIDE, 4 or 8, floats at once, as the including file
// says. Lanes do not touch each other: the same bits for both.
#pragma once

#include "mesh/cluster.h"
#include "mesh/query.h"

#include <string.h>

struct nearest_search {
    const struct mesh *mesh;
    const struct cluster_tree *tree;
    vec3 p;
    float p_single[3];
    double margin; // how far a distance in single precision may be off
    double limit;  // the largest distance until something is found
    float square;  // in single precision: what is farther cannot be within the limit
    bool found;
    struct closest best;
};

void nearest_limit(struct nearest_search *search, double limit);
void nearest_try(struct nearest_search *search, uint32_t triangle);

// What a processor may have; each finds the same.
void nearest_search_plain(struct nearest_search *search);
void nearest_search_avx2(struct nearest_search *search);

#define LANES_INLINE static inline __attribute__((always_inline))

typedef float lanes __attribute__((vector_size(WIDE * sizeof(float))));
typedef int32_t lane_mask __attribute__((vector_size(WIDE * sizeof(int32_t))));

LANES_INLINE lanes load(const float *from) {
    lanes out;
    memcpy(&out, from, sizeof out);
    return out;
}

LANES_INLINE lanes spread(float value) {
    lanes zero = {0};
    return zero + value;
}

LANES_INLINE lanes choose(lane_mask mask, lanes yes, lanes no) {
    return (lanes)((mask & (lane_mask)yes) | (~mask & (lane_mask)no));
}

LANES_INLINE lanes smaller(lanes a, lanes b) {
    return choose(a < b, a, b);
}

LANES_INLINE lanes above_zero(lanes a) {
    return (lanes)((a > 0.0f) & (lane_mask)a);
}

LANES_INLINE lanes clamp(lanes value, lanes most) {
    return smaller(above_zero(value), most);
}

LANES_INLINE lanes dot(const cluster_lanes a[3], int at, const lanes b[3]) {
    return load(a[0] + at) * b[0] + load(a[1] + at) * b[1] + load(a[2] + at) * b[2];
}

// ---- clusters -----------------------------------------------------------------------------------

// From (x, y) to the side from the origin to (to_x, to_y), in the plane.
LANES_INLINE lanes square_to_side(lanes x, lanes y, lanes to_x, lanes to_y, lanes inv_square) {
    lanes t = clamp((x * to_x + y * to_y) * inv_square, spread(1));
    lanes off_x = x - t * to_x, off_y = y - t * to_y;
    return off_x * off_x + off_y * off_y;
}

// Square distances from p to triangles of a cluster. Their roots are off from the true distances by
// a few roundings of |p − a| (at most 8 FLT_EPSILON (|p| + |a|)).
LANES_INLINE lanes cluster_squares(const struct cluster *c, int at, const float p[3]) {
    lanes ap[3] = {p[0] - load(c->a[0] + at), p[1] - load(c->a[1] + at), p[2] - load(c->a[2] + at)};
    lanes x = dot(c->x, at, ap), y = dot(c->y, at, ap), z = dot(c->z, at, ap);
    lanes b_x = load(c->b_x + at), c_x = load(c->c_x + at), c_y = load(c->c_y + at);
    lanes from_b = x - b_x, bc_x = c_x - b_x, off_ab = x - clamp(x, b_x);
    lanes square = off_ab * off_ab + y * y;
    square = smaller(square, square_to_side(x, y, c_x, c_y, load(c->inv_ac + at)));
    square = smaller(square, square_to_side(from_b, y, bc_x, c_y, load(c->inv_bc + at)));
    lane_mask inside = (y > 0.0f) & (bc_x * y > c_y * from_b) & (c_y * x > c_x * y);
    return (lanes)(~inside & (lane_mask)square) + z * z;
}

// Single precision finds who may be the closest, double precision decides.
LANES_INLINE void visit_cluster(struct nearest_search *s, const struct cluster *cluster) {
    cluster_lanes squares;
    for (int at = 0; at < CLUSTER_SIZE; at += WIDE) {
        lanes some = cluster_squares(cluster, at, s->p_single);
        memcpy(squares + at, &some, sizeof some);
    }
    for (int i = 0; i < CLUSTER_SIZE; i++)
        if (squares[i] <= s->square)
            nearest_try(s, cluster->triangles[i]);
}

// ---- boxes --------------------------------------------------------------------------------------

LANES_INLINE lanes box_squares(const struct cluster_boxes *boxes, int at, const float p[3]) {
    lanes sum = {0};
    for (int axis = 0; axis < 3; axis++) {
        lanes below = load(boxes->low[axis] + at) - p[axis];
        lanes above = p[axis] - load(boxes->high[axis] + at);
        lanes off = above_zero(choose(below > above, below, above));
        sum += off * off;
    }
    return sum;
}

struct visit {
    float square;
    int level; // of a box
    uint32_t box;
};

#define VISITS_MAX (CLUSTER_LEVELS_MAX * CLUSTER_SIZE)

// The nearest comes to the top of the stack.
LANES_INLINE int push_boxes(const struct nearest_search *s, int level, uint32_t block,
                            struct visit *stack, int depth) {
    const struct cluster_boxes *boxes = &s->tree->levels[level][block];
    uint32_t first = block * CLUSTER_SIZE, count = s->tree->counts[level] - first;
    int from = depth;
    cluster_lanes squares;
    for (int at = 0; at < CLUSTER_SIZE; at += WIDE) {
        lanes some = box_squares(boxes, at, s->p_single);
        memcpy(squares + at, &some, sizeof some);
    }
    for (uint32_t i = 0; i < CLUSTER_SIZE && i < count; i++) {
        if (!(squares[i] <= s->square))
            continue;
        int at = depth++;
        for (; at > from && stack[at - 1].square < squares[i]; at--)
            stack[at] = stack[at - 1];
        stack[at] = (struct visit){squares[i], level, first + i};
    }
    return depth;
}

LANES_INLINE void search_tree(struct nearest_search *s) {
    struct visit stack[VISITS_MAX];
    int depth = push_boxes(s, s->tree->level_count - 1, 0, stack, 0);
    while (depth > 0) {
        struct visit visit = stack[--depth];
        if (!(visit.square <= s->square))
            continue;
        if (visit.level == 0)
            visit_cluster(s, &s->tree->clusters[visit.box]);
        else
            depth = push_boxes(s, visit.level - 1, visit.box, stack, depth);
    }
}
