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

// Whether corners of one triangle are so far to one side of another's plane that side_of is sure to
// say so. It is where the plane is exact to much less than OFF_MM: of a triangle with some area, near
// by. Those that both share do not count.
static bool are_beside(const struct soup *soup, uint32_t corners_of, uint32_t plane_of,
                       const bool shared[3]) {
    const struct soup_plane *plane = &soup->planes[plane_of];
    const vec3 *corners = soup->at[corners_of].corners;
    bool above = true, below = true;
    if (soup->at[plane_of].area2 < AREA2_MIN ||
        soup->planes[corners_of].radius + plane->radius > RADII_MAX)
        return false;
    for (int i = 0; i < 3; i++) {
        double height = vec3_dot(plane->normal, corners[i]) - plane->offset;
        above &= shared[i] || height > OFF_MM;
        below &= shared[i] || height < -OFF_MM;
    }
    return above || below;
}

static bool has_corner(const uint32_t *triangle, uint32_t vertex) {
    return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
}

static bool edges_pierce(const struct conform *c, uint32_t a, uint32_t b) {
    const uint32_t *va = c->surface->triangles + 3 * (size_t)c->self.at[a].id;
    const uint32_t *vb = c->surface->triangles + 3 * (size_t)c->self.at[b].id;
    const vec3 *from = c->self.at[a].corners, *through = c->self.at[b].corners;
    bool shared[3];
    int sides[3];
    for (int i = 0; i < 3; i++)
        shared[i] = has_corner(vb, va[i]);
    if (shared[0] + shared[1] + shared[2] > 1)
        return false; // no edge is left
    if (are_beside(&c->self, a, b, shared))
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
    uint32_t index; // in the soup, of a live triangle
    struct box box;
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

static void try_pair(void *context, uint32_t other) {
    struct pairing *pairing = context;
    struct conform *c = pairing->c;
    const struct soup_triangle *a = &c->self.at[pairing->index], *b = &c->self.at[other];
    if (other == pairing->index || (b->mark && other < pairing->index) ||
        !boxes_meet(pairing->box, box_of(b->corners)))
        return;
    if (!edges_pierce(c, pairing->index, other) && !edges_pierce(c, other, pairing->index))
        return;
    pairing->count++;
    for (int i = 0; i < 3; i++) {
        c->tied[c->surface->triangles[3 * (size_t)a->id + (size_t)i]] = 1;
        c->tied[c->surface->triangles[3 * (size_t)b->id + (size_t)i]] = 1;
    }
}

uint32_t conform_cross(struct conform *c) {
    struct pairing pairing = {.c = c};
    memset(c->tied, 0, c->surface->vertex_count);
    conform_widen(c);
    conform_make_self(c);
    for (uint32_t i = 0; i < c->self.count; i++) {
        if (!c->self.at[i].mark)
            continue;
        pairing.index = i;
        pairing.box = box_of(c->self.at[i].corners);
        soup_near(&c->self, pairing.box, try_pair, &pairing);
    }
    return pairing.count;
}
