// Searches in a soup.
#define WIDE 4
#define WIDE_TARGET
#include "match/soup_walk.h"

#include <float.h>
#include <string.h>

#define SLACK_MM 1e-9 // more than sums of lengths are rounded

// The faces through which a normal may look that has facing · normal >= least: with n.z the
// largest, facing · n <= facing.z + |facing.x| + |facing.y|, or less than 0.
static int32_t faces_towards(vec3 facing, double least) {
    const double *f = &facing.x, sum = fabs(f[0]) + fabs(f[1]) + fabs(f[2]);
    int32_t faces = 0;
    if (least <= 0)
        return INT32_MAX;
    for (int i = 0; i < 3; i++) {
        faces |= (int32_t)(sum - fabs(f[i]) + f[i] > least - SLACK_MM) << 2 * i;
        faces |= (int32_t)(sum - fabs(f[i]) - f[i] > least - SLACK_MM) << (2 * i + 1);
    }
    return faces;
}

static void at_weights(const vec3 c[3], double u, double v, bool on_face,
                       struct soup_closest *out) {
    out->weights[0] = 1 - u - v;
    out->weights[1] = u;
    out->weights[2] = v;
    out->on_face = on_face;
    out->point =
        vec3_add_scaled(vec3_add_scaled(c[0], u, vec3_sub(c[1], c[0])), v, vec3_sub(c[2], c[0]));
}

// By the regions of Voronoi (Ericson, Real-Time Collision Detection, 5.1.5).
static void closest_weights(const vec3 c[3], vec3 p, struct soup_closest *out) {
    vec3 ab = vec3_sub(c[1], c[0]), ac = vec3_sub(c[2], c[0]);
    vec3 ap = vec3_sub(p, c[0]), bp = vec3_sub(p, c[1]), cp = vec3_sub(p, c[2]);
    double d1 = vec3_dot(ab, ap), d2 = vec3_dot(ac, ap), d3 = vec3_dot(ab, bp);
    double d4 = vec3_dot(ac, bp), d5 = vec3_dot(ab, cp), d6 = vec3_dot(ac, cp);
    double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    if (d1 <= 0 && d2 <= 0)
        at_weights(c, 0, 0, false, out);
    else if (d3 >= 0 && d4 <= d3)
        at_weights(c, 1, 0, false, out);
    else if (d6 >= 0 && d5 <= d6)
        at_weights(c, 0, 1, false, out);
    else if (vc <= 0 && d1 >= 0 && d3 <= 0)
        at_weights(c, d1 / (d1 - d3), 0, false, out);
    else if (vb <= 0 && d2 >= 0 && d6 <= 0)
        at_weights(c, 0, d2 / (d2 - d6), false, out);
    else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        at_weights(c, 1 - w, w, false, out);
    } else
        at_weights(c, vb / (va + vb + vc), vc / (va + vb + vc), true, out);
}

void soup_closest_on(const struct soup *soup, uint32_t index, vec3 point,
                     struct soup_closest *out) {
    closest_weights(soup->at[index].corners, point, out);
    out->index = index;
    out->distance = vec3_distance(point, out->point);
}

// ---- the closest point: the tree ----------------------------------------------------------------

static struct place place_of(const struct soup *soup, vec3 p) {
    vec3 off = vec3_sub(p, soup->origin);
    double farthest = higher(fabs(off.x), higher(fabs(off.y), fabs(off.z)));
    return (struct place){{(float)off.x, (float)off.y, (float)off.z},
                          32 * (double)FLT_EPSILON * (soup->reach + farthest) + SLACK_MM};
}

static void note_best(struct looking *s) {
    double distance = s->best->distance + SLACK_MM, near = s->best->distance + s->place.margin;
    s->distance = distance;
    s->distance2 = distance * distance;
    s->square = (float)(near * near * (1 + 8 * (double)FLT_EPSILON));
}

// False only where the triangle is no answer.
static bool may_be_closer(const struct soup_plane *plane, const struct looking *s) {
    if (!(vec3_dot(s->search->facing, plane->normal) >= s->search->least))
        return false;
    double off = vec3_dot(plane->normal, s->search->point) - plane->offset;
    vec3 away = vec3_sub(s->search->point, plane->middle);
    double reach = s->distance + plane->radius;
    return off * off <= s->distance2 && vec3_dot(away, away) <= reach * reach;
}

void soup_look_at(struct looking *s, uint32_t t) {
    if (t == s->best->index || !may_be_closer(&s->soup->planes[t], s))
        return;
    struct soup_closest found;
    soup_closest_on(s->soup, t, s->search->point, &found);
    if (found.distance < s->best->distance ||
        (found.distance == s->best->distance && t < s->best->index)) {
        *s->best = found;
        note_best(s);
    }
}

void soup_walk_plain(struct looking *s) {
    walk(s);
}

static void walk_best(struct looking *s) {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        soup_walk_avx2(s);
        return;
    }
#endif
    soup_walk_plain(s);
}

struct looking soup_begin(const struct soup *soup, const struct soup_search *search,
                          struct soup_closest *out) {
    struct looking s = {.soup = soup, .search = search, .best = out};
    *out = (struct soup_closest){.index = MESH_NONE, .distance = search->within};
    s.place = place_of(soup, search->point);
    s.faces = faces_towards(search->facing, search->least);
    note_best(&s);
    return s;
}

bool soup_closest(const struct soup *soup, const struct soup_search *search,
                  struct soup_closest *out) {
    struct looking s = soup_begin(soup, search, out);
    if (search->hint < soup->count)
        soup_look_at(&s, search->hint);
    if (soup->count)
        walk_best(&s);
    return out->index != MESH_NONE;
}

bool soup_closest_among(const struct soup *soup, const struct soup_search *search,
                        const uint32_t *indices, uint32_t count, struct soup_closest *out) {
    struct looking s = {.soup = soup, .search = search, .best = out};
    *out = (struct soup_closest){.index = MESH_NONE, .distance = search->within};
    note_best(&s);
    for (uint32_t i = 0; i < count; i++)
        soup_look_at(&s, indices[i]);
    return out->index != MESH_NONE;
}

// ---- near a box ---------------------------------------------------------------------------------

struct nearing {
    const struct soup *soup;
    struct place place; // of the box's middle
    float half[3];      // of it, and a hair
    int32_t faces;
    void (*visit)(void *context, uint32_t index);
    void *context;
};

static void set_box(struct nearing *n, struct box box) {
    vec3 half = vec3_scale(0.5, vec3_sub(box.max, box.min));
    n->place = place_of(n->soup, vec3_add(box.min, half));
    for (int i = 0; i < 3; i++)
        n->half[i] = (float)((&half.x)[i] + n->place.margin);
}

static inline uint32_t boxes_near(const struct nearing *n, const struct soup_boxes *boxes) {
    uint32_t near = 0;
    for (int at = 0; at < EIGHT; at += WIDE) {
        lane_mask beside = {0};
        for (int i = 0; i < 3; i++)
            beside |= beyond(load(boxes->middle[i] + at) - n->place.at[i],
                             load(boxes->half[i] + at)) > n->half[i];
        near |= bits_of(~beside & facing(boxes, at, n->faces)) << at;
    }
    return near;
}

static void look_near(const struct nearing *n, int level, uint32_t block) {
    const struct soup_boxes *boxes = &n->soup->blocks[n->soup->starts[level] + block];
    for (uint32_t near = boxes_near(n, boxes); near; near &= near - 1) {
        uint32_t box = EIGHT * block + (uint32_t)__builtin_ctz(near);
        if (level > 0)
            look_near(n, level - 1, box);
        else
            n->visit(n->context, n->soup->order[box].number);
    }
}

static void near_through(const struct soup *soup, struct box box, int32_t faces,
                         void (*visit)(void *context, uint32_t index), void *context) {
    struct nearing n = {.soup = soup, .faces = faces, .visit = visit, .context = context};
    if (!soup->count)
        return;
    set_box(&n, box);
    look_near(&n, soup->level_count - 1, 0);
}

void soup_near(const struct soup *soup, struct box box,
               void (*visit)(void *context, uint32_t index), void *context) {
    near_through(soup, box, INT32_MAX, visit, context);
}

struct facing_search {
    const struct soup *soup;
    vec3 facing;
    double least;
    void (*visit)(void *context, uint32_t index);
    void *context;
};

static void visit_facing(void *context, uint32_t index) {
    const struct facing_search *s = context;
    if (vec3_dot(s->facing, s->soup->planes[index].normal) >= s->least)
        s->visit(s->context, index);
}

void soup_near_facing(const struct soup *soup, struct box box, vec3 facing, double least,
                      void (*visit)(void *context, uint32_t index), void *context) {
    struct facing_search search = {soup, facing, least, visit, context};
    near_through(soup, box, faces_towards(facing, least), visit_facing, &search);
}
