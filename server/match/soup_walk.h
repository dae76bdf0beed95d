// The walk through a soup's tree for one CPU level: WIDE, 4 or 8, boxes at once, for WIDE_TARGET,
// as the including file says. Lanes do not touch each other: the same bits for both.
#pragma once

#include "match/soup.h"

#include <string.h>

// In single precision, with a margin for its rounding.
struct place {
    float at[3];
    double margin; // how far a distance may be off
};

struct looking {
    const struct soup *soup;
    const struct soup_search *search;
    struct soup_closest *best;
    struct place place;
    int32_t faces;   // that an answer may look through
    double distance; // of the best, and a hair: what is farther is no answer
    double distance2;
    float square; // the same for boxes
};

// A search that has looked at nothing yet.
struct looking soup_begin(const struct soup *soup, const struct soup_search *search,
                          struct soup_closest *out);
void soup_look_at(struct looking *s, uint32_t triangle);

// What a processor may have; each finds the same.
void soup_walk_plain(struct looking *s);
void soup_walk_avx2(struct looking *s);

#define LANES_INLINE static inline __attribute__((always_inline)) WIDE_TARGET

// ---- eight boxes at once ------------------------------------------------------------------------

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

// How far from the middle of a box beyond its half: no less than 0.
LANES_INLINE lanes beyond(lanes off, lanes half) {
    off = (lanes)((lane_mask)off & INT32_MAX) - half;
    return (lanes)((off > 0.0f) & (lane_mask)off);
}

// Which of them have a normal that looks through one of the faces.
LANES_INLINE lane_mask facing(const struct soup_boxes *boxes, int at, int32_t faces) {
    lane_mask all;
    memcpy(&all, boxes->faces + at, sizeof all);
    return (all & faces) != 0;
}

// ---- the tree -----------------------------------------------------------------------------------

// Which of eight boxes may have the answer, one bit for each; and their square distances.
LANES_INLINE uint32_t boxes_of(const struct looking *s, const struct soup_boxes *boxes,
                               float out_squares[EIGHT]) {
    const float *p = s->place.at;
    uint32_t within = 0;
    for (int at = 0; at < EIGHT; at += WIDE) {
        lanes sum = {0};
        for (int i = 0; i < 3; i++) {
            lanes off = beyond(load(boxes->middle[i] + at) - p[i], load(boxes->half[i] + at));
            sum += off * off;
        }
        memcpy(out_squares + at, &sum, sizeof sum);
        within |= bits_of((sum <= s->square) & facing(boxes, at, s->faces)) << at;
    }
    return within;
}

struct visit {
    float square;
    int level; // of a block
    uint32_t block;
};

#define VISITS_MAX (SOUP_LEVELS_MAX * EIGHT)

// The nearest comes to the top of the stack.
LANES_INLINE int look_in_block(struct looking *s, struct visit visit, struct visit *stack,
                               int depth) {
    const struct soup *soup = s->soup;
    const struct soup_boxes *boxes = &soup->blocks[soup->starts[visit.level] + visit.block];
    float squares[EIGHT];
    int from = depth;
    for (uint32_t near = boxes_of(s, boxes, squares); near; near &= near - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(near), box = EIGHT * visit.block + i;
        if (visit.level == 0) {
            soup_look_at(s, soup->order[box].number);
            continue;
        }
        int at = depth++;
        for (; at > from && stack[at - 1].square < squares[i]; at--)
            stack[at] = stack[at - 1];
        stack[at] = (struct visit){squares[i], visit.level - 1, box};
    }
    return depth;
}

LANES_INLINE void walk(struct looking *s) {
    struct visit stack[VISITS_MAX];
    stack[0] = (struct visit){0, s->soup->level_count - 1, 0};
    for (int depth = 1; depth > 0;) {
        struct visit visit = stack[--depth];
        if (visit.square <= s->square)
            depth = look_in_block(s, visit, stack, depth);
    }
}
