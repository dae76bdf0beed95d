// The search of query.c for one CPU level: WIDE, 4 or 8, floats at once, for WIDE_TARGET, as the
// including file says. Lanes do not touch each other: the same bits for both.
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
    struct query_near *near; // to be filled, or looked at; NULL: none
    float near_square;       // what is farther is not for it
    double moved;            // since it was filled, INFINITY where it is another query's
};

void nearest_limit(struct nearest_search *search, double limit);
void nearest_try(struct nearest_search *search, uint32_t triangle);

// A search passes something by at that distance, squared; or keeps a cluster for the next ones.
void nearest_pass(struct nearest_search *search, float square);
void nearest_keep(struct nearest_search *search, uint32_t cluster, float square);

// What a processor may have; each finds the same. A look asks only the clusters in `near`.
void nearest_search_plain(struct nearest_search *search);
void nearest_search_avx2(struct nearest_search *search);
void nearest_look_plain(struct nearest_search *search);
void nearest_look_avx2(struct nearest_search *search);

#define LANES_INLINE static inline __attribute__((always_inline)) WIDE_TARGET

typedef float lanes __attribute__((vector_size(WIDE * sizeof(float))));
typedef int32_t lane_mask __attribute__((vector_size(WIDE * sizeof(int32_t))));

// One bit for each lane.
LANES_INLINE uint32_t bits_of(lane_mask mask) {
#if defined(__x86_64__) && WIDE == 8
    return (uint32_t)__builtin_ia32_movmskps256((lanes)mask);
#elif defined(__x86_64__)
    return (uint32_t)__builtin_ia32_movmskps((lanes)mask);
#else
    uint32_t bits = 0;
    for (int i = 0; i < WIDE; i++)
        bits |= (uint32_t)(mask[i] & 1) << i;
    return bits;
#endif
}

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
LANES_INLINE void visit_cluster(struct nearest_search *s, uint32_t index, bool keeps) {
    const struct cluster *cluster = &s->tree->clusters[index];
    cluster_lanes squares;
    uint32_t within = 0;
    for (int at = 0; at < CLUSTER_SIZE; at += WIDE) {
        lanes some = cluster_squares(cluster, at, s->p_single);
        memcpy(squares + at, &some, sizeof some);
        within |= bits_of(some <= s->square) << at;
    }
    for (; within; within &= within - 1) {
        int i = __builtin_ctz(within);
        if (squares[i] <= s->square)
            nearest_try(s, cluster->triangles[i]);
    }
    if (keeps) {
        float least = squares[0];
        for (int i = 1; i < CLUSTER_SIZE; i++)
            least = squares[i] < least ? squares[i] : least;
        nearest_keep(s, index, least);
    }
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
LANES_INLINE int push_boxes(struct nearest_search *s, int level, uint32_t block,
                            struct visit *stack, int depth, bool keeps) {
    const struct cluster_boxes *boxes = &s->tree->levels[level][block];
    uint32_t first = block * CLUSTER_SIZE, count = s->tree->counts[level] - first, within = 0;
    int from = depth;
    float most = keeps ? s->near_square : s->square;
    cluster_lanes squares;
    for (int at = 0; at < CLUSTER_SIZE; at += WIDE) {
        lanes some = box_squares(boxes, at, s->p_single);
        memcpy(squares + at, &some, sizeof some);
        within |= bits_of(some <= most) << at;
    }
    within &= count < CLUSTER_SIZE ? (1U << count) - 1 : ~0U;
    for (int i = 0; keeps && i < CLUSTER_SIZE; i++)
        if (!(within >> i & 1))
            nearest_pass(s, squares[i]);
    for (; within; within &= within - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(within);
        int at = depth++;
        for (; at > from && stack[at - 1].square < squares[i]; at--)
            stack[at] = stack[at - 1];
        stack[at] = (struct visit){squares[i], level, first + i};
    }
    return depth;
}

LANES_INLINE void walk_tree(struct nearest_search *s, bool keeps) {
    struct visit stack[VISITS_MAX];
    int depth = push_boxes(s, s->tree->level_count - 1, 0, stack, 0, keeps);
    while (depth > 0) {
        struct visit visit = stack[--depth];
        bool is_near = visit.square <= (keeps ? s->near_square : s->square);
        if (!is_near && keeps)
            nearest_pass(s, visit.square);
        if (!is_near)
            continue;
        if (visit.level == 0)
            visit_cluster(s, visit.box, keeps);
        else
            depth = push_boxes(s, visit.level - 1, visit.box, stack, depth, keeps);
    }
}

LANES_INLINE void search_tree(struct nearest_search *s) {
    if (s->near)
        walk_tree(s, true);
    else
        walk_tree(s, false);
}

LANES_INLINE void look_near(struct nearest_search *s) {
    const struct query_near *near = s->near;
    for (uint32_t i = 0; i < near->count && (double)near->away[i] - s->moved <= s->limit; i++)
        visit_cluster(s, near->clusters[i], false);
}
