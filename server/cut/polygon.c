#include "cut/polygon.h"

#include "cut/flat.h"

#include <stdlib.h>

#define FLAT 1e-9 // ratio of height to length that a triangle should have

struct polygon_node {
    struct flat_point p;
    uint32_t vertex;
    uint32_t next, previous;
    double quality; // as an ear; below 0: not to be cut off yet
};

struct polygon_filler {
    struct flat plane;
    struct side_table *drawn; // no side is drawn twice, in whatever polygon
    struct polygon_node *nodes;
    uint32_t count, room;
    struct ids rings;   // a node of each
    struct ids corners; // of the triangles
};

struct polygon_filler *polygon_create(void) {
    return alloc(1, sizeof(struct polygon_filler));
}

void polygon_destroy(struct polygon_filler **filler) {
    struct polygon_filler *p = *filler;
    free(p->nodes);
    ids_fini(&p->rings);
    ids_fini(&p->corners);
    free(p);
    *filler = NULL;
}

static bool is_drawn(const struct polygon_filler *f, uint32_t a, uint32_t b) {
    return a == b || sides_has(f->drawn, a < b ? a : b, a < b ? b : a);
}

static void draw_side(struct side_table *drawn, uint32_t a, uint32_t b) {
    sides_enter(drawn, (struct side_entry){.from = a < b ? a : b, .to = a < b ? b : a});
}

static void draw_edge(struct polygon_filler *f, uint32_t a, uint32_t b) {
    draw_side(f->drawn, a, b);
}

static uint32_t add_node(struct polygon_filler *f, struct polygon_node node) {
    f->nodes = array_grow(f->nodes, &f->room, f->count + 1, sizeof *f->nodes);
    f->nodes[f->count] = node;
    return f->count++;
}

// ---- holes: a bridge to each, the shortest that crosses nothing ----

static bool crosses(struct flat_point a, struct flat_point b, struct flat_point c,
                    struct flat_point d) {
    return (flat_cross(a, b, c) > 0) != (flat_cross(a, b, d) > 0) &&
           (flat_cross(c, d, a) > 0) != (flat_cross(c, d, b) > 0);
}

// Whether a bridge from the node to p starts into the polygon.
static bool looks_inside(const struct polygon_filler *f, uint32_t i, struct flat_point p) {
    const struct polygon_node *n = &f->nodes[i];
    struct flat_point before = f->nodes[n->previous].p, after = f->nodes[n->next].p;
    bool left_of_in = flat_cross(before, n->p, p) > 0, left_of_out = flat_cross(n->p, after, p) > 0;
    return flat_cross(before, n->p, after) > 0 ? left_of_in && left_of_out
                                               : left_of_in || left_of_out;
}

static bool sees(const struct polygon_filler *f, uint32_t i, uint32_t k) {
    const struct polygon_node *a = &f->nodes[i], *b = &f->nodes[k];
    if (!looks_inside(f, i, b->p) || !looks_inside(f, k, a->p))
        return false;
    for (uint32_t e = 0; e < f->count; e++) {
        const struct polygon_node *c = &f->nodes[e], *d = &f->nodes[c->next];
        if (c->vertex == a->vertex || c->vertex == b->vertex || d->vertex == a->vertex ||
            d->vertex == b->vertex)
            continue;
        if (crosses(a->p, b->p, c->p, d->p))
            return false;
    }
    return true;
}

static double square_distance(struct flat_point a, struct flat_point b) {
    return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
}

struct bridge {
    uint32_t outer, hole;
    double square; // of its length
};

static struct bridge find_bridge(const struct polygon_filler *f, uint32_t outer, uint32_t hole,
                                 bool must_see) {
    struct bridge best = {outer, hole, INFINITY};
    uint32_t h = hole;
    do {
        uint32_t o = outer;
        do {
            double square = square_distance(f->nodes[h].p, f->nodes[o].p);
            if (square < best.square && !is_drawn(f, f->nodes[h].vertex, f->nodes[o].vertex) &&
                (!must_see || sees(f, o, h)))
                best = (struct bridge){o, h, square};
            o = f->nodes[o].next;
        } while (o != outer);
        h = f->nodes[h].next;
    } while (h != hole);
    return best;
}

static void link_nodes(struct polygon_filler *f, uint32_t a, uint32_t b) {
    f->nodes[a].next = b;
    f->nodes[b].previous = a;
}

static bool join_hole(struct polygon_filler *f, uint32_t outer, uint32_t hole) {
    struct bridge bridge = find_bridge(f, outer, hole, true);
    if (!isfinite(bridge.square))
        bridge = find_bridge(f, outer, hole, false);
    if (!isfinite(bridge.square))
        return false;
    uint32_t o = bridge.outer, h = bridge.hole;
    uint32_t o_after = f->nodes[o].next, h_before = f->nodes[h].previous;
    uint32_t o_again = add_node(f, f->nodes[o]), h_again = add_node(f, f->nodes[h]);
    link_nodes(f, o, h);
    link_nodes(f, h_before, h_again);
    link_nodes(f, h_again, o_again);
    link_nodes(f, o_again, o_after);
    draw_edge(f, f->nodes[o].vertex, f->nodes[h].vertex);
    return true;
}

// ---- ears ----

enum strictness { STRICT, RELAXED, FORCED };

// The diagonal from c to a first: most points lie beyond it.
static bool covers(struct flat_point a, struct flat_point b, struct flat_point c,
                   struct flat_point p, enum strictness strictness) {
    double ca = flat_cross(c, a, p);
    if (!(strictness == STRICT ? ca >= 0 : ca > 0))
        return false;
    double ab = flat_cross(a, b, p), bc = flat_cross(b, c, p);
    return strictness == STRICT ? ab >= 0 && bc >= 0 : ab > 0 && bc > 0;
}

// Height over length, about; below 0 where the ear must not be cut off.
static double quality_of(const struct polygon_filler *f, uint32_t i, enum strictness strictness) {
    const struct polygon_node *b = &f->nodes[i], *a = &f->nodes[b->previous],
                              *c = &f->nodes[b->next];
    double longest = higher(square_distance(a->p, b->p),
                            higher(square_distance(b->p, c->p), square_distance(c->p, a->p)));
    double quality = longest > 0 ? flat_cross(a->p, b->p, c->p) / longest : 0;
    if (strictness != FORCED && quality < (strictness == STRICT ? FLAT : -FLAT))
        return -1;
    if (strictness == FORCED)
        return is_drawn(f, a->vertex, c->vertex) ? -1 : quality + 2; // which is above 0
    for (uint32_t k = c->next; k != b->previous; k = f->nodes[k].next) {
        const struct polygon_node *n = &f->nodes[k];
        if (covers(a->p, b->p, c->p, n->p, strictness) && n->vertex != a->vertex &&
            n->vertex != b->vertex && n->vertex != c->vertex)
            return -1;
    }
    return is_drawn(f, a->vertex, c->vertex) ? -1 : quality + FLAT;
}

static uint32_t best_ear(const struct polygon_filler *f, uint32_t start) {
    uint32_t best = start, i = start;
    do {
        if (f->nodes[i].quality > f->nodes[best].quality)
            best = i;
        i = f->nodes[i].next;
    } while (i != start);
    return best;
}

static void judge_all(struct polygon_filler *f, uint32_t start, enum strictness strictness) {
    uint32_t i = start;
    do {
        f->nodes[i].quality = quality_of(f, i, strictness);
        i = f->nodes[i].next;
    } while (i != start);
}

static uint32_t find_ear(struct polygon_filler *f, uint32_t start) {
    uint32_t ear = best_ear(f, start);
    for (int strictness = STRICT; f->nodes[ear].quality < 0 && strictness <= FORCED; strictness++) {
        judge_all(f, start, (enum strictness)strictness);
        ear = best_ear(f, start);
    }
    return ear;
}

static void add_triangle(struct polygon_filler *f, const struct polygon_node *a,
                         const struct polygon_node *b, const struct polygon_node *c) {
    ids_push(&f->corners, a->vertex);
    ids_push(&f->corners, b->vertex);
    ids_push(&f->corners, c->vertex);
}

static bool cut_ears(struct polygon_filler *f, uint32_t start, uint32_t count) {
    if (count > 3)
        judge_all(f, start, STRICT);
    while (count > 3) {
        uint32_t ear = find_ear(f, start);
        uint32_t before = f->nodes[ear].previous, after = f->nodes[ear].next;
        if (f->nodes[ear].quality < 0)
            return false;
        if (is_drawn(f, f->nodes[before].vertex, f->nodes[after].vertex)) { // since it was judged
            f->nodes[ear].quality = -1;
            continue;
        }
        draw_edge(f, f->nodes[before].vertex, f->nodes[after].vertex);
        add_triangle(f, &f->nodes[before], &f->nodes[ear], &f->nodes[after]);
        link_nodes(f, before, after);
        start = after;
        if (--count == 3)
            break;
        f->nodes[before].quality = quality_of(f, before, STRICT);
        f->nodes[after].quality = quality_of(f, after, STRICT);
    }
    const struct polygon_node *a = &f->nodes[start], *b = &f->nodes[a->next];
    add_triangle(f, a, b, &f->nodes[b->next]);
    return true;
}

// ---- a polygon ----

void polygon_draw_ring(struct side_table *drawn, const uint32_t *vertices, uint32_t count) {
    for (uint32_t i = 0; i < count; i++)
        draw_side(drawn, vertices[i], vertices[i + 1 < count ? i + 1 : 0]);
}

void polygon_begin(struct polygon_filler *f, struct side_table *drawn, vec3 normal, vec3 origin) {
    f->plane = flat_on(normal, origin);
    f->drawn = drawn;
    f->count = f->rings.count = f->corners.count = 0;
}

void polygon_add_ring(struct polygon_filler *f, const vec3 *points, const uint32_t *vertices,
                      uint32_t count) {
    CHECK(count >= 3);
    uint32_t first = f->count;
    for (uint32_t i = 0; i < count; i++)
        add_node(f, (struct polygon_node){flat_of(&f->plane, points[vertices[i]]), vertices[i],
                                          first + i + 1, first + i - 1, -1});
    link_nodes(f, f->count - 1, first);
    ids_push(&f->rings, first);
}

const char *polygon_fill(struct polygon_filler *f, const uint32_t **out_corners,
                         uint32_t *out_count) {
    *out_count = 0;
    for (uint32_t h = 1; h < f->rings.count; h++)
        if (!join_hole(f, f->rings.at[0], f->rings.at[h]))
            return "a hole in a polygon cannot be reached";
    if (!cut_ears(f, f->rings.at[0], f->count))
        return "a polygon has no triangles that are not drawn already";
    *out_corners = f->corners.at;
    *out_count = f->corners.count / 3;
    return NULL;
}
