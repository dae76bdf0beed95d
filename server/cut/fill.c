#include "cut/fill.h"

#include "cut/flat.h"
#include "cut/stage.h"

#include <stdlib.h>

// Polygons with holes into triangles. Whatever the polygon looks like, a ring of n vertices becomes
// n - 2 triangles whose sides pair up inside it; where rounding has bent it, they may be flat or
// overlap by as much.

#define FLAT 1e-9 // ratio of height to length that a triangle should have

struct node {
    struct flat_point p;
    uint32_t vertex;
    uint32_t next, previous;
    double quality; // as an ear; below 0: not to be cut off yet
};

struct filler {
    struct node *nodes;
    uint32_t count, room;
    struct ids holes;         // a node of each
    struct side_table *drawn; // no side is drawn twice, in whatever polygon
};

struct filler *filler_create(void) {
    return alloc(1, sizeof(struct filler));
}

void filler_destroy(struct filler **filler) {
    free((*filler)->nodes);
    ids_fini(&(*filler)->holes);
    free(*filler);
    *filler = NULL;
}

static bool is_drawn(const struct filler *f, uint32_t a, uint32_t b) {
    return a == b || sides_has(f->drawn, a < b ? a : b, a < b ? b : a);
}

static void draw(struct filler *f, uint32_t a, uint32_t b) {
    sides_enter(f->drawn, (struct side_entry){a < b ? a : b, a < b ? b : a, 0, false, false});
}

static uint32_t add_node(struct filler *f, struct node node) {
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
static bool looks_inside(const struct filler *f, uint32_t i, struct flat_point p) {
    const struct node *n = &f->nodes[i];
    struct flat_point before = f->nodes[n->previous].p, after = f->nodes[n->next].p;
    bool left_of_in = flat_cross(before, n->p, p) > 0, left_of_out = flat_cross(n->p, after, p) > 0;
    return flat_cross(before, n->p, after) > 0 ? left_of_in && left_of_out
                                               : left_of_in || left_of_out;
}

static bool sees(const struct filler *f, uint32_t i, uint32_t k) {
    const struct node *a = &f->nodes[i], *b = &f->nodes[k];
    if (!looks_inside(f, i, b->p) || !looks_inside(f, k, a->p))
        return false;
    for (uint32_t e = 0; e < f->count; e++) {
        const struct node *c = &f->nodes[e], *d = &f->nodes[c->next];
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

static struct bridge find_bridge(const struct filler *f, uint32_t outer, uint32_t hole,
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

static void link_nodes(struct filler *f, uint32_t a, uint32_t b) {
    f->nodes[a].next = b;
    f->nodes[b].previous = a;
}

static bool join_hole(struct filler *f, uint32_t outer, uint32_t hole) {
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
    draw(f, f->nodes[o].vertex, f->nodes[h].vertex);
    return true;
}

// ---- ears ----

enum strictness { STRICT, RELAXED, FORCED };

static bool covers(struct flat_point a, struct flat_point b, struct flat_point c,
                   struct flat_point p, enum strictness strictness) {
    double ab = flat_cross(a, b, p), bc = flat_cross(b, c, p), ca = flat_cross(c, a, p);
    return strictness == STRICT ? ab >= 0 && bc >= 0 && ca >= 0 : ab > 0 && bc > 0 && ca > 0;
}

// Height over length, about; below 0 where the ear must not be cut off.
static double quality_of(const struct filler *f, uint32_t i, enum strictness strictness) {
    const struct node *b = &f->nodes[i], *a = &f->nodes[b->previous], *c = &f->nodes[b->next];
    double longest = fmax(square_distance(a->p, b->p),
                          fmax(square_distance(b->p, c->p), square_distance(c->p, a->p)));
    double quality = longest > 0 ? flat_cross(a->p, b->p, c->p) / longest : 0;
    if (strictness != FORCED && quality < (strictness == STRICT ? FLAT : -FLAT))
        return -1;
    if (is_drawn(f, a->vertex, c->vertex))
        return -1;
    if (strictness == FORCED)
        return quality + 2; // which is above 0
    for (uint32_t k = c->next; k != b->previous; k = f->nodes[k].next) {
        const struct node *n = &f->nodes[k];
        if (n->vertex != a->vertex && n->vertex != b->vertex && n->vertex != c->vertex &&
            covers(a->p, b->p, c->p, n->p, strictness))
            return -1;
    }
    return quality + FLAT;
}

static uint32_t best_ear(const struct filler *f, uint32_t start) {
    uint32_t best = start, i = start;
    do {
        if (f->nodes[i].quality > f->nodes[best].quality)
            best = i;
        i = f->nodes[i].next;
    } while (i != start);
    return best;
}

static void judge_all(struct filler *f, uint32_t start, enum strictness strictness) {
    uint32_t i = start;
    do {
        f->nodes[i].quality = quality_of(f, i, strictness);
        i = f->nodes[i].next;
    } while (i != start);
}

static uint32_t find_ear(struct filler *f, uint32_t start) {
    uint32_t ear = best_ear(f, start);
    for (int strictness = STRICT; f->nodes[ear].quality < 0 && strictness <= FORCED; strictness++) {
        judge_all(f, start, (enum strictness)strictness);
        ear = best_ear(f, start);
    }
    return ear;
}

static void add_made(struct stage *stage, uint32_t label, const struct node *a,
                     const struct node *b, const struct node *c) {
    stage->made =
        array_grow(stage->made, &stage->made_room, stage->made_count + 1, sizeof *stage->made);
    stage->made[stage->made_count++] =
        (struct new_triangle){{a->vertex, b->vertex, c->vertex}, label};
}

static bool cut_ears(struct stage *stage, struct filler *f, uint32_t label, uint32_t start,
                     uint32_t count) {
    if (count > 3)
        judge_all(f, start, STRICT);
    while (count > 3) {
        uint32_t ear = find_ear(f, start);
        uint32_t before = f->nodes[ear].previous, after = f->nodes[ear].next;
        if (f->nodes[ear].quality < 0)
            return stage_refuse(stage, "a polygon has no triangles that are not drawn already");
        if (is_drawn(f, f->nodes[before].vertex, f->nodes[after].vertex)) { // since it was judged
            f->nodes[ear].quality = -1;
            continue;
        }
        draw(f, f->nodes[before].vertex, f->nodes[after].vertex);
        add_made(stage, label, &f->nodes[before], &f->nodes[ear], &f->nodes[after]);
        link_nodes(f, before, after);
        f->nodes[before].quality = quality_of(f, before, STRICT);
        f->nodes[after].quality = quality_of(f, after, STRICT);
        start = after;
        count--;
    }
    const struct node *a = &f->nodes[start], *b = &f->nodes[a->next];
    add_made(stage, label, a, b, &f->nodes[b->next]);
    return true;
}

// ---- regions ----

static uint32_t add_ring(const struct cut_mesh *mesh, struct stage *stage, struct filler *f,
                         const struct flat *flat, const struct ring *ring) {
    uint32_t first = f->count;
    for (uint32_t i = 0; i < ring->count; i++) {
        uint32_t vertex = stage->ring_vertices.at[ring->first + i];
        add_node(f, (struct node){flat_of(flat, mesh->points[vertex]), vertex, first + i + 1,
                                  first + i - 1, -1});
    }
    link_nodes(f, f->count - 1, first);
    return first;
}

// Rings of two vertices are slits: both sides are borders of others, which will find each other.
static bool fill_region(const struct cut_mesh *mesh, struct stage *stage, uint32_t index) {
    const struct region *region = &stage->regions[index];
    const struct ring *rings = stage->rings + region->first_ring;
    struct filler *f = stage->filler;
    if (rings[0].count < 3)
        return true;
    struct flat flat =
        flat_on(region->normal, mesh->points[stage->ring_vertices.at[rings[0].first]]);
    f->count = 0;
    f->holes.count = 0;
    uint32_t outer = add_ring(mesh, stage, f, &flat, &rings[0]);
    for (uint32_t r = 1; r < region->ring_count; r++)
        if (rings[r].count >= 3)
            ids_push(&f->holes, add_ring(mesh, stage, f, &flat, &rings[r]));
    for (uint32_t h = 0; h < f->holes.count; h++)
        if (!join_hole(f, outer, f->holes.at[h]))
            return stage_refuse(stage, "a hole in a polygon cannot be reached");
    return cut_ears(stage, f, region->label, outer, f->count);
}

static void draw_rings(struct stage *stage) {
    struct filler *f = stage->filler;
    f->drawn = &stage->drawn;
    sides_clear(f->drawn, 2 * stage->ring_vertices.count + 4 * stage->ring_count);
    for (uint32_t r = 0; r < stage->ring_count; r++) {
        const uint32_t *v = stage->ring_vertices.at + stage->rings[r].first;
        for (uint32_t i = 0, last = stage->rings[r].count - 1; i <= last; i++)
            draw(f, v[i], v[i < last ? i + 1 : 0]);
    }
}

bool fill_regions(const struct cut_mesh *mesh, struct stage *stage) {
    draw_rings(stage);
    for (uint32_t i = 0; i < stage->region_count; i++)
        if (!fill_region(mesh, stage, i))
            return false;
    return true;
}
