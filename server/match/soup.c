#include "match/soup.h"

#include "base/check.h"
#include "match/room.h"

#include <stdlib.h>
#include <string.h>

#define CELL_MM 0.5
#define CELLS_MAX 60000
#define AREA2_MIN 1e-10 // mm²: less is no area

void soup_fini(struct soup *soup) {
    free(soup->at);
    free(soup->first);
    free(soup->entries);
    free(soup->stamps);
    *soup = (struct soup){0};
}

void soup_clear(struct soup *soup) {
    soup->count = 0;
}

void soup_add(struct soup *soup, const vec3 corners[3], uint32_t id, bool mark) {
    vec3 area2 = soup_area2(corners);
    double length = vec3_length(area2);
    room_for(&soup->at, &soup->room, soup->count + 1);
    struct soup_triangle *t = &soup->at[soup->count++];
    memcpy(t->corners, corners, sizeof t->corners);
    t->normal = length > AREA2_MIN ? vec3_scale(1 / length, area2) : (vec3){0};
    t->id = id;
    t->mark = mark;
}

// ---- cells --------------------------------------------------------------------------------------

struct cells {
    int low[3], high[3];
};

static int cell_of(double x, double origin, double cell, int size) {
    double at = floor((x - origin) / cell);
    return at < 0 ? 0 : at >= size ? size - 1 : (int)at;
}

static struct cells cells_of(const struct soup *soup, struct box box) {
    const double *o = &soup->origin.x, *low = &box.min.x, *high = &box.max.x;
    struct cells cells;
    for (int i = 0; i < 3; i++) {
        cells.low[i] = cell_of(low[i], o[i], soup->cell, soup->size[i]);
        cells.high[i] = cell_of(high[i], o[i], soup->cell, soup->size[i]);
    }
    return cells;
}

static size_t cell_index(const struct soup *soup, int x, int y, int z) {
    return ((size_t)x * (size_t)soup->size[1] + (size_t)y) * (size_t)soup->size[2] + (size_t)z;
}

static struct box box_of(const vec3 c[3]) {
    return (struct box){{lower(c[0].x, lower(c[1].x, c[2].x)), lower(c[0].y, lower(c[1].y, c[2].y)),
                         lower(c[0].z, lower(c[1].z, c[2].z))},
                        {higher(c[0].x, higher(c[1].x, c[2].x)),
                         higher(c[0].y, higher(c[1].y, c[2].y)),
                         higher(c[0].z, higher(c[1].z, c[2].z))}};
}

static void place_cells(struct soup *soup) {
    struct box all = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    double *low = &all.min.x, *high = &all.max.x, cells;
    for (uint32_t t = 0; t < soup->count; t++) {
        struct box box = box_of(soup->at[t].corners);
        const double *l = &box.min.x, *h = &box.max.x;
        for (int i = 0; i < 3; i++) {
            low[i] = lower(low[i], l[i]);
            high[i] = higher(high[i], h[i]);
        }
    }
    soup->origin = all.min;
    soup->cell = CELL_MM / 1.25;
    do {
        soup->cell *= 1.25;
        cells = 1;
        for (int i = 0; i < 3; i++)
            cells *= floor((high[i] - low[i]) / soup->cell) + 1;
    } while (cells > CELLS_MAX);
    for (int i = 0; i < 3; i++)
        soup->size[i] = (int)floor((high[i] - low[i]) / soup->cell) + 1;
}

#define FOR_CELLS(soup, cells, index)                                                              \
    for (int cx = (cells).low[0]; cx <= (cells).high[0]; cx++)                                     \
        for (int cy = (cells).low[1]; cy <= (cells).high[1]; cy++)                                 \
            for (size_t index = cell_index(soup, cx, cy, (cells).low[2]),                          \
                        end = cell_index(soup, cx, cy, (cells).high[2]);                           \
                 index <= end; index++)

void soup_build(struct soup *soup) {
    if (!soup->count)
        return;
    place_cells(soup);
    uint32_t cells =
        (uint32_t)cell_index(soup, soup->size[0] - 1, soup->size[1] - 1, soup->size[2] - 1) + 1;
    room_for(&soup->first, &soup->first_room, cells + 2);
    memset(soup->first, 0, (cells + 2) * sizeof *soup->first);
    for (uint32_t t = 0; t < soup->count; t++) {
        struct cells near = cells_of(soup, box_of(soup->at[t].corners));
        FOR_CELLS(soup, near, i)
        soup->first[i + 2]++;
    }
    for (uint32_t i = 0; i < cells; i++)
        soup->first[i + 2] += soup->first[i + 1];
    room_for(&soup->entries, &soup->entry_room, soup->first[cells + 1]);
    for (uint32_t t = 0; t < soup->count;
         t++) { // first[i + 1] grows from a cell's start to its end
        struct cells near = cells_of(soup, box_of(soup->at[t].corners));
        FOR_CELLS(soup, near, i)
        soup->entries[soup->first[i + 1]++] = t;
    }
    room_for(&soup->stamps, &soup->stamp_room, soup->count);
    memset(soup->stamps, 0, soup->count * sizeof *soup->stamps);
    soup->stamp = 0;
}

static void next_stamp(struct soup *soup) {
    if (++soup->stamp)
        return;
    memset(soup->stamps, 0, soup->count * sizeof *soup->stamps);
    soup->stamp = 1;
}

void soup_near(struct soup *soup, struct box box, void (*visit)(void *context, uint32_t index),
               void *context) {
    if (!soup->count)
        return;
    next_stamp(soup);
    struct cells near = cells_of(soup, box);
    FOR_CELLS(soup, near, i)
    for (uint32_t k = soup->first[i]; k < soup->first[i + 1]; k++) {
        uint32_t t = soup->entries[k];
        if (soup->stamps[t] == soup->stamp)
            continue;
        soup->stamps[t] = soup->stamp;
        visit(context, t);
    }
}

// ---- the closest point --------------------------------------------------------------------------

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

struct shells {
    const struct soup_search *search;
    struct soup_closest *best;
    int middle[3];
};

static void look_at(struct soup *soup, struct shells *s, uint32_t t) {
    if (soup->stamps[t] == soup->stamp)
        return;
    soup->stamps[t] = soup->stamp;
    vec3 normal = soup->at[t].normal;
    if (vec3_dot(s->search->facing, normal) < s->search->least || !vec3_dot(normal, normal))
        return;
    struct soup_closest found;
    soup_closest_on(soup, t, s->search->point, &found);
    if (found.distance < s->best->distance ||
        (found.distance == s->best->distance && t < s->best->index))
        *s->best = found;
}

static double beyond(double x, double low, double high) {
    return higher(0, higher(low - x, x - high));
}

static void look_in_cell(struct soup *soup, struct shells *s, int x, int y, int z) {
    if (x < 0 || y < 0 || z < 0 || x >= soup->size[0] || y >= soup->size[1] || z >= soup->size[2])
        return;
    size_t i = cell_index(soup, x, y, z);
    if (soup->first[i] == soup->first[i + 1])
        return;
    vec3 low = vec3_add_scaled(soup->origin, soup->cell, (vec3){x, y, z}), p = s->search->point;
    vec3 off = {beyond(p.x, low.x, low.x + soup->cell), beyond(p.y, low.y, low.y + soup->cell),
                beyond(p.z, low.z, low.z + soup->cell)};
    if (vec3_dot(off, off) > s->best->distance * s->best->distance)
        return;
    for (uint32_t k = soup->first[i]; k < soup->first[i + 1]; k++)
        look_at(soup, s, soup->entries[k]);
}

static void look_in_shell(struct soup *soup, struct shells *s, int k) {
    for (int x = -k; x <= k; x++)
        for (int y = -k; y <= k; y++) {
            int step = abs(x) == k || abs(y) == k || !k ? 1 : 2 * k;
            for (int z = -k; z <= k; z += step)
                look_in_cell(soup, s, s->middle[0] + x, s->middle[1] + y, s->middle[2] + z);
        }
}

// How far a point may be and still lie in no cell outside the shell.
static double free_radius(const struct soup *soup, const struct shells *s, int shell) {
    const double *p = &s->search->point.x, *o = &soup->origin.x;
    double radius = INFINITY;
    for (int i = 0; i < 3; i++) {
        double low = o[i] + soup->cell * (s->middle[i] - shell);
        double high = o[i] + soup->cell * (s->middle[i] + shell + 1);
        if (s->middle[i] - shell > 0)
            radius = lower(radius, p[i] - low);
        if (s->middle[i] + shell < soup->size[i] - 1)
            radius = lower(radius, high - p[i]);
    }
    return radius;
}

bool soup_closest(struct soup *soup, const struct soup_search *search, struct soup_closest *out) {
    *out = (struct soup_closest){.index = MESH_NONE, .distance = search->within};
    if (!soup->count)
        return false;
    struct shells s = {search, out, {0}};
    const double *p = &search->point.x, *o = &soup->origin.x;
    for (int i = 0; i < 3; i++)
        s.middle[i] = cell_of(p[i], o[i], soup->cell, soup->size[i]);
    next_stamp(soup);
    if (search->hint < soup->count)
        look_at(soup, &s, search->hint);
    for (int k = 0;; k++) {
        look_in_shell(soup, &s, k);
        if (free_radius(soup, &s, k) > out->distance ||
            k > soup->size[0] + soup->size[1] + soup->size[2])
            break;
    }
    return out->index != MESH_NONE;
}
