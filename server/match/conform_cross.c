#include "match/conform_parts.h"

#include <math.h>
#include <string.h>

// ---- exact enough: differences of near doubles are exact in 64 bits of mantissa -----------------

struct long_vec3 {
    long double x, y, z;
};

static struct long_vec3 away(vec3 a, vec3 from) {
    return (struct long_vec3){(long double)a.x - (long double)from.x,
                              (long double)a.y - (long double)from.y,
                              (long double)a.z - (long double)from.z};
}

static int long_side_of(vec3 a, vec3 b, vec3 c, vec3 d) {
    struct long_vec3 u = away(a, d), v = away(b, d), w = away(c, d);
    long double m[6] = {u.x * v.y * w.z, u.y * v.z * w.x, u.z * v.x * w.y,
                        u.z * v.y * w.x, u.y * v.x * w.z, u.x * v.z * w.y};
    long double det = m[0] + m[1] + m[2] - m[3] - m[4] - m[5], bound = 0;
    for (int i = 0; i < 6; i++)
        bound += fabsl(m[i]);
    bound *= 16 * 0x1p-63L;
    return (det > bound) - (det < -bound);
}

// The side of the plane a b c that d lies on; 0 where rounding could have made the sign.
static int side_of(vec3 a, vec3 b, vec3 c, vec3 d) {
    vec3 u = vec3_sub(a, d), v = vec3_sub(b, d), w = vec3_sub(c, d);
    double m[6] = {u.x * v.y * w.z, u.y * v.z * w.x, u.z * v.x * w.y,
                   u.z * v.y * w.x, u.y * v.x * w.z, u.x * v.z * w.y};
    double det = m[0] + m[1] + m[2] - m[3] - m[4] - m[5], bound = 0;
    for (int i = 0; i < 6; i++)
        bound += fabs(m[i]);
    bound *= 1e-14;
    if (det > bound || det < -bound)
        return det > 0 ? 1 : -1;
    return long_side_of(a, b, c, d);
}

// Whether an edge goes through a triangle, given the sides of its plane that the ends lie on. What
// rounding leaves open counts as through, but not an edge that lies in the plane.
static bool pierces(vec3 from, vec3 to, int one, int other, const vec3 c[3]) {
    if (one * other > 0 || (!one && !other))
        return false;
    int u = side_of(from, to, c[0], c[1]), v = side_of(from, to, c[1], c[2]);
    if (u * v < 0)
        return false;
    int w = side_of(from, to, c[2], c[0]);
    return v * w >= 0 && w * u >= 0;
}

#define OFF_MM 1e-6
#define AREA2_MIN 1e-3
#define RADII_MAX 2.0

struct side {
    const vec3 *corners;
    const uint32_t *vertices;
    const struct soup_plane *plane; // NULL: not known
    double area2;
};

// Whether corners of one triangle are so far to one side of another's plane that side_of is sure to
// say so. It is where the plane is exact to much less than OFF_MM: of a triangle with some area,
// near by. Those that both share do not count.
static bool are_beside(const struct side *a, const struct side *b, const bool shared[3]) {
    bool above = true, below = true;
    if (!a->plane || !b->plane || b->area2 < AREA2_MIN ||
        a->plane->radius + b->plane->radius > RADII_MAX)
        return false;
    for (int i = 0; i < 3; i++) {
        double height = vec3_dot(b->plane->normal, a->corners[i]) - b->plane->offset;
        above &= shared[i] || height > OFF_MM;
        below &= shared[i] || height < -OFF_MM;
    }
    return above || below;
}

static bool has_corner(const uint32_t *triangle, uint32_t vertex) {
    return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
}

static bool edges_pierce(const struct side *a, const struct side *b) {
    const vec3 *from = a->corners, *through = b->corners;
    bool shared[3];
    int sides[3];
    for (int i = 0; i < 3; i++)
        shared[i] = has_corner(b->vertices, a->vertices[i]);
    if (shared[0] + shared[1] + shared[2] > 1)
        return false; // no edge is left
    if (are_beside(a, b, shared))
        return false;
    for (int i = 0; i < 3; i++)
        sides[i] = shared[i] ? 0 : side_of(through[0], through[1], through[2], from[i]);
    for (int i = 0; i < 3; i++) {
        int k = (i + 1) % 3;
        if (!shared[i] && !shared[k] && pierces(from[i], from[k], sides[i], sides[k], through))
            return true;
    }
    return false;
}

// ---- pairs --------------------------------------------------------------------------------------

struct pairing {
    struct conform *c;
    struct side side;
    struct box box;
    uint32_t index; // in the soup; MESH_NONE: it is not there
    uint32_t count;
};

static struct box box_of(const vec3 c[3]) {
    struct box box = {c[0], c[0]};
    for (int i = 1; i < 3; i++) {
        box.min =
            (vec3){lower(box.min.x, c[i].x), lower(box.min.y, c[i].y), lower(box.min.z, c[i].z)};
        box.max =
            (vec3){higher(box.max.x, c[i].x), higher(box.max.y, c[i].y), higher(box.max.z, c[i].z)};
    }
    return box;
}

static bool boxes_meet(struct box a, struct box b) {
    return a.min.x <= b.max.x && b.min.x <= a.max.x && a.min.y <= b.max.y && b.min.y <= a.max.y &&
           a.min.z <= b.max.z && b.min.z <= a.max.z;
}

static struct side side_in_soup(const struct conform *c, uint32_t index) {
    const struct soup_triangle *t = &c->self.at[index];
    return (struct side){t->corners, c->surface->triangles + 3 * (size_t)t->id,
                         &c->self.planes[index], t->area2};
}

// Of two live ones, that with the lower index asks.
static void try_pair(void *context, uint32_t other) {
    struct pairing *pairing = context;
    struct conform *c = pairing->c;
    const struct soup_triangle *b = &c->self.at[other];
    bool asks = pairing->index == MESH_NONE
                    ? b->mark
                    : other != pairing->index && !(b->mark && other < pairing->index);
    if (!asks || !boxes_meet(pairing->box, box_of(b->corners)))
        return;
    struct side side = side_in_soup(c, other);
    if (!edges_pierce(&pairing->side, &side) && !edges_pierce(&side, &pairing->side))
        return;
    pairing->count++;
    for (int i = 0; i < 3; i++) {
        c->tied[pairing->side.vertices[i]] = 1;
        c->tied[side.vertices[i]] = 1;
    }
}

static void try_all(struct pairing *pairing) {
    pairing->box = box_of(pairing->side.corners);
    soup_near(&pairing->c->self, pairing->box, try_pair, pairing);
}

// What is near since the soup was built, which has all that are live.
static void try_new(struct pairing *pairing) {
    struct conform *c = pairing->c;
    pairing->index = MESH_NONE;
    for (uint32_t i = 0, k = 0; i < c->near_count; i++) {
        vec3 corners[3];
        while (k < c->self.count && c->self.at[k].id < c->near[i])
            k++;
        if (k < c->self.count && c->self.at[k].id == c->near[i])
            continue;
        conform_corners(c, c->near[i], corners);
        pairing->side = (struct side){.corners = corners,
                                      .vertices = c->surface->triangles + 3 * (size_t)c->near[i]};
        try_all(pairing);
    }
}

uint32_t conform_cross(struct conform *c) {
    struct pairing pairing = {.c = c};
    bool was_made = c->is_made;
    memset(c->tied, 0, c->surface->vertex_count);
    conform_widen(c);
    (was_made ? conform_move_self : conform_make_self)(c);
    for (uint32_t i = 0; i < c->self.count; i++) {
        if (!c->self.at[i].mark)
            continue;
        pairing.index = i;
        pairing.side = side_in_soup(c, i);
        try_all(&pairing);
    }
    if (!c->is_made)
        try_new(&pairing);
    return pairing.count;
}
