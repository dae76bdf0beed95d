#include "cutting/crossings.h"

#include "base/check.h"

#include <math.h>
#include <stdlib.h>

// ---- exact enough: differences of near doubles are exact in 64 bits of mantissa -----------------

typedef struct {
    long double x, y, z;
} long_vec3;

static long_vec3 away(vec3 a, vec3 from) {
    return (long_vec3){(long double)a.x - (long double)from.x,
                       (long double)a.y - (long double)from.y,
                       (long double)a.z - (long double)from.z};
}

// The side of the plane a b c that d lies on; 0 where rounding could have made the sign.
static int side_of(vec3 a, vec3 b, vec3 c, vec3 d) {
    long_vec3 u = away(a, d), v = away(b, d), w = away(c, d);
    long double m[6] = {u.x * v.y * w.z, u.y * v.z * w.x, u.z * v.x * w.y,
                        u.z * v.y * w.x, u.y * v.x * w.z, u.x * v.z * w.y};
    long double det = m[0] + m[1] + m[2] - m[3] - m[4] - m[5], bound = 0;
    for (int i = 0; i < 6; i++)
        bound += fabsl(m[i]);
    bound *= 16 * 0x1p-63L;
    return (det > bound) - (det < -bound);
}

static bool pierces(vec3 from, vec3 to, const vec3 c[3]) {
    if (side_of(c[0], c[1], c[2], from) * side_of(c[0], c[1], c[2], to) >= 0)
        return false;
    int side = side_of(from, to, c[0], c[1]);
    return side && side == side_of(from, to, c[1], c[2]) && side == side_of(from, to, c[2], c[0]);
}

static bool has_corner(const uint32_t *triangle, uint32_t vertex) {
    return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
}

static bool edges_pierce(const struct snapshot *surface, uint32_t a, uint32_t b) {
    const uint32_t *va = surface->triangles + 3 * (size_t)a;
    const uint32_t *vb = surface->triangles + 3 * (size_t)b;
    vec3 c[3];
    snapshot_corners(surface, b, c);
    for (int i = 0; i < 3; i++) {
        uint32_t from = va[i], to = va[(i + 1) % 3];
        if (!has_corner(vb, from) && !has_corner(vb, to) &&
            pierces(surface->vertices[from], surface->vertices[to], c))
            return true;
    }
    return false;
}

// ---- pairs whose boxes meet, by a sweep along x -------------------------------------------------

struct entry {
    struct box box;
    uint32_t triangle;
};

static int compare(const void *a, const void *b) {
    const struct entry *x = a, *y = b;
    return x->box.min.x != y->box.min.x ? (x->box.min.x > y->box.min.x ? 1 : -1)
                                        : (x->triangle > y->triangle) - (x->triangle < y->triangle);
}

static struct entry *entries_of(const struct snapshot *surface) {
    struct entry *entries = alloc(surface->triangle_count, sizeof *entries), *entry = entries;
    for (uint32_t t = 0; t < surface->triangle_bound; t++) {
        if (!snapshot_has(surface, t))
            continue;
        vec3 c[3];
        snapshot_corners(surface, t, c);
        vec3 low = c[0], high = c[0];
        for (int i = 1; i < 3; i++) {
            low = (vec3){fmin(low.x, c[i].x), fmin(low.y, c[i].y), fmin(low.z, c[i].z)};
            high = (vec3){fmax(high.x, c[i].x), fmax(high.y, c[i].y), fmax(high.z, c[i].z)};
        }
        *entry++ = (struct entry){{low, high}, t};
    }
    qsort(entries, surface->triangle_count, sizeof *entries, compare);
    return entries;
}

int snapshot_crossings(const struct snapshot *surface) {
    struct entry *entries = entries_of(surface);
    int pairs = 0;
    for (uint32_t i = 0; i < surface->triangle_count; i++)
        for (uint32_t k = i + 1; k < surface->triangle_count; k++) {
            const struct box *a = &entries[i].box, *b = &entries[k].box;
            if (b->min.x > a->max.x)
                break;
            if (b->min.y > a->max.y || b->max.y < a->min.y || b->min.z > a->max.z ||
                b->max.z < a->min.z)
                continue;
            uint32_t s = entries[i].triangle, t = entries[k].triangle;
            pairs += edges_pierce(surface, s, t) || edges_pierce(surface, t, s);
        }
    free(entries);
    return pairs;
}
