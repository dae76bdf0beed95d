#include "match/soup.h"

#include "base/check.h"
#include "match/room.h"

#include <stdlib.h>
#include <string.h>

#define CELL_MM 0.5
#define CELLS_MAX 60000
#define AREA2_MIN 1e-10 // mm²: less is no area
#define ROOM_MM 0.1     // by which a marked triangle may move within its cells
#define HAIR 1e-6       // of a number: more than a float rounds it
#define SLACK_MM 1e-9   // more than sums of lengths are rounded

void soup_fini(struct soup *soup) {
    free(soup->at);
    free(soup->first);
    free(soup->faces);
    free(soup->entries);
    free(soup->bounds);
    free(soup->cells);
    free(soup->rooms);
    *soup = (struct soup){0};
}

void soup_clear(struct soup *soup) {
    soup->count = 0;
}

static void set_corners(struct soup_triangle *t, const vec3 corners[3]) {
    vec3 area2 = soup_area2(corners);
    double length = vec3_length(area2);
    memcpy(t->corners, corners, sizeof t->corners);
    t->normal = length > AREA2_MIN ? vec3_scale(1 / length, area2) : (vec3){0};
}

void soup_add(struct soup *soup, const vec3 corners[3], uint32_t id, bool mark) {
    room_for(&soup->at, &soup->room, soup->count + 1);
    struct soup_triangle *t = &soup->at[soup->count++];
    set_corners(t, corners);
    t->id = id;
    t->mark = mark;
}

// ---- cells --------------------------------------------------------------------------------------

static int cell_of(const struct soup *soup, double x, int axis) {
    double at = (x - (&soup->origin.x)[axis]) * soup->per_mm;
    int size = soup->size[axis];
    return !(at > 0) ? 0 : at >= size ? size - 1 : (int)at;
}

static struct soup_cells cells_of(const struct soup *soup, struct box box) {
    const double *low = &box.min.x, *high = &box.max.x;
    struct soup_cells cells;
    for (int i = 0; i < 3; i++) {
        cells.low[i] = (uint16_t)cell_of(soup, low[i], i);
        cells.high[i] = (uint16_t)cell_of(soup, high[i], i);
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

static bool lies_in(struct box inner, struct box outer) {
    return outer.min.x <= inner.min.x && inner.max.x <= outer.max.x && outer.min.y <= inner.min.y &&
           inner.max.y <= outer.max.y && outer.min.z <= inner.min.z && inner.max.z <= outer.max.z;
}

static void place_cells(struct soup *soup) {
    struct box all = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    double *low = &all.min.x, *high = &all.max.x, cells;
    for (uint32_t t = 0; t < soup->count; t++) {
        const double *l = &soup->rooms[t].min.x, *h = &soup->rooms[t].max.x;
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
    soup->per_mm = 1 / soup->cell;
    for (int i = 0; i < 3; i++)
        soup->size[i] = (int)floor((high[i] - low[i]) / soup->cell) + 1;
}

#define FOR_CELLS(soup, cells, index)                                                              \
    for (int cx = (cells).low[0]; cx <= (cells).high[0]; cx++)                                     \
        for (int cy = (cells).low[1]; cy <= (cells).high[1]; cy++)                                 \
            for (size_t index = cell_index(soup, cx, cy, (cells).low[2]),                          \
                        end = cell_index(soup, cx, cy, (cells).high[2]);                           \
                 index <= end; index++)

// ---- what a search asks first -------------------------------------------------------------------

// Of a cube around the normal, the face that it looks through.
static uint8_t face_of(vec3 n) {
    double x = fabs(n.x), y = fabs(n.y), z = fabs(n.z);
    if (x >= y && x >= z)
        return n.x > 0 ? 1 : 2;
    return y >= z ? n.y > 0 ? 4 : 8 : n.z > 0 ? 16 : 32;
}

// The faces through which a normal may look that has facing · normal >= least: with n.z the
// largest, facing · n <= facing.z + |facing.x| + |facing.y|, or less than 0.
static uint8_t faces_towards(vec3 facing, double least) {
    const double *f = &facing.x, sum = fabs(f[0]) + fabs(f[1]) + fabs(f[2]);
    uint8_t faces = 0;
    if (least <= 0)
        return UINT8_MAX;
    for (int i = 0; i < 3; i++) {
        faces |= (uint8_t)((sum - fabs(f[i]) + f[i] > least - SLACK_MM) << 2 * i);
        faces |= (uint8_t)((sum - fabs(f[i]) - f[i] > least - SLACK_MM) << (2 * i + 1));
    }
    return faces;
}

static void set_bound(struct soup *soup, uint32_t index, struct box box) {
    const struct soup_triangle *t = &soup->at[index];
    struct soup_bound *bound = &soup->bounds[index];
    const double *low = &box.min.x, *high = &box.max.x;
    bool has_area = vec3_dot(t->normal, t->normal) > 0;
    bound->normal = has_area ? t->normal : (vec3){NAN, NAN, NAN};
    bound->offset = vec3_dot(t->normal, t->corners[0]);
    for (int i = 0; i < 3; i++) {
        bound->low[i] = (float)(low[i] - HAIR * fabs(low[i]));
        bound->high[i] = (float)(high[i] + HAIR * fabs(high[i]));
    }
}

static void make_room(struct soup *soup) {
    room_for(&soup->bounds, &soup->bound_room, soup->count);
    room_for(&soup->cells, &soup->cell_room, soup->count);
    room_for(&soup->rooms, &soup->room_room, soup->count);
    for (uint32_t t = 0; t < soup->count; t++) {
        struct box box = box_of(soup->at[t].corners);
        double by = soup->at[t].mark ? ROOM_MM : 0;
        set_bound(soup, t, box);
        soup->bounds[t].stamp = 0;
        soup->rooms[t] = (struct box){vec3_sub(box.min, (vec3){by, by, by}),
                                      vec3_add(box.max, (vec3){by, by, by})};
    }
    soup->stamp = 0;
}

void soup_build(struct soup *soup) {
    if (!soup->count)
        return;
    make_room(soup);
    place_cells(soup);
    uint32_t cells =
        (uint32_t)cell_index(soup, soup->size[0] - 1, soup->size[1] - 1, soup->size[2] - 1) + 1;
    room_for(&soup->first, &soup->first_room, cells + 2);
    room_for(&soup->faces, &soup->face_room, cells);
    memset(soup->first, 0, (cells + 2) * sizeof *soup->first);
    memset(soup->faces, 0, cells * sizeof *soup->faces);
    for (uint32_t t = 0; t < soup->count; t++) {
        uint8_t face = face_of(soup->at[t].normal);
        soup->cells[t] = cells_of(soup, soup->rooms[t]);
        FOR_CELLS(soup, soup->cells[t], i) {
            soup->first[i + 2]++;
            soup->faces[i] |= face;
        }
    }
    for (uint32_t i = 0; i < cells; i++)
        soup->first[i + 2] += soup->first[i + 1];
    room_for(&soup->entries, &soup->entry_room, soup->first[cells + 1]);
    for (uint32_t t = 0; t < soup->count;
         t++) { // first[i + 1] grows from a cell's start to its end
        struct soup_entry entry = {t, face_of(soup->at[t].normal)};
        FOR_CELLS(soup, soup->cells[t], i)
        soup->entries[soup->first[i + 1]++] = entry;
    }
}

static void turn(struct soup *soup, uint32_t index, uint8_t face) {
    FOR_CELLS(soup, soup->cells[index], i) {
        soup->faces[i] |= face;
        for (uint32_t k = soup->first[i]; k < soup->first[i + 1]; k++)
            if (soup->entries[k].triangle == index)
                soup->entries[k].face = face;
    }
}

bool soup_move(struct soup *soup, uint32_t index, const vec3 corners[3]) {
    struct soup_triangle *t = &soup->at[index];
    struct box box = box_of(corners);
    uint8_t before = face_of(t->normal);
    set_corners(t, corners);
    set_bound(soup, index, box);
    uint8_t face = face_of(t->normal);
    if (face != before)
        turn(soup, index, face);
    return lies_in(box, soup->rooms[index]);
}

static void next_stamp(struct soup *soup) {
    if (++soup->stamp)
        return;
    for (uint32_t t = 0; t < soup->count; t++)
        soup->bounds[t].stamp = 0;
    soup->stamp = 1;
}

void soup_near(struct soup *soup, struct box box, void (*visit)(void *context, uint32_t index),
               void *context) {
    if (!soup->count)
        return;
    next_stamp(soup);
    struct soup_cells near = cells_of(soup, box);
    FOR_CELLS(soup, near, i)
    for (uint32_t k = soup->first[i]; k < soup->first[i + 1]; k++) {
        uint32_t t = soup->entries[k].triangle;
        if (soup->bounds[t].stamp == soup->stamp)
            continue;
        soup->bounds[t].stamp = soup->stamp;
        visit(context, t);
    }
}

bool soup_may_face(const struct soup *soup, struct box box, vec3 facing, double least) {
    uint8_t towards = faces_towards(facing, least), faces = 0;
    struct soup_cells near = cells_of(soup, box);
    FOR_CELLS(soup, near, i)
    faces |= soup->faces[i];
    return faces & towards;
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

struct looking {
    const struct soup_search *search;
    struct soup_closest *best;
    uint8_t faces;    // that an answer may look through
    double distance2; // of the best, and a hair: what is farther is no answer
    int middle[3];
};

static void note_best(struct looking *s) {
    double distance = s->best->distance + SLACK_MM;
    s->distance2 = distance * distance;
}

static double beyond(double x, double low, double high) {
    return higher(0, higher(low - x, x - high));
}

// False only where the triangle is no answer.
static bool may_be_closer(const struct soup_bound *bound, const struct looking *s) {
    vec3 p = s->search->point, n = bound->normal;
    if (!(vec3_dot(s->search->facing, n) >= s->search->least))
        return false;
    double off = vec3_dot(n, p) - bound->offset;
    if (off * off > s->distance2)
        return false;
    vec3 by = {beyond(p.x, (double)bound->low[0], (double)bound->high[0]),
               beyond(p.y, (double)bound->low[1], (double)bound->high[1]),
               beyond(p.z, (double)bound->low[2], (double)bound->high[2])};
    return vec3_dot(by, by) <= s->distance2;
}

static void look_at(struct soup *soup, struct looking *s, uint32_t t) {
    struct soup_bound *bound = &soup->bounds[t];
    if (bound->stamp == soup->stamp)
        return;
    bound->stamp = soup->stamp;
    if (!may_be_closer(bound, s))
        return;
    struct soup_closest found;
    soup_closest_on(soup, t, s->search->point, &found);
    if (found.distance < s->best->distance ||
        (found.distance == s->best->distance && t < s->best->index)) {
        *s->best = found;
        note_best(s);
    }
}

// How far p is from a row of cells along an axis, squared.
static double off_row2(const struct soup *soup, vec3 point, int axis, int row) {
    const double *p = &point.x, *o = &soup->origin.x;
    double low = o[axis] + soup->cell * row, off = beyond(p[axis], low, low + soup->cell);
    return off * off;
}

static void look_in_cell(struct soup *soup, struct looking *s, size_t i) {
    if (!(soup->faces[i] & s->faces))
        return;
    for (uint32_t k = soup->first[i]; k < soup->first[i + 1]; k++)
        if (soup->entries[k].face & s->faces)
            look_at(soup, s, soup->entries[k].triangle);
}

// All cells that the best may lie in.
static void look_around(struct soup *soup, struct looking *s) {
    vec3 p = s->search->point;
    double by = s->best->distance + SLACK_MM;
    struct box box = {vec3_sub(p, (vec3){by, by, by}), vec3_add(p, (vec3){by, by, by})};
    struct soup_cells near = cells_of(soup, box);
    for (int x = near.low[0]; x <= near.high[0]; x++) {
        double off_x2 = off_row2(soup, p, 0, x);
        for (int y = near.low[1]; y <= near.high[1]; y++) {
            double off_xy2 = off_x2 + off_row2(soup, p, 1, y);
            for (int z = near.low[2]; z <= near.high[2] && off_xy2 <= s->distance2; z++)
                if (off_xy2 + off_row2(soup, p, 2, z) <= s->distance2)
                    look_in_cell(soup, s, cell_index(soup, x, y, z));
        }
    }
}

static void look_in_shell(struct soup *soup, struct looking *s, int k) {
    vec3 p = s->search->point;
    const int *m = s->middle, *size = soup->size;
    for (int x = m[0] - k < 0 ? 0 : m[0] - k; x <= m[0] + k && x < size[0]; x++)
        for (int y = m[1] - k < 0 ? 0 : m[1] - k; y <= m[1] + k && y < size[1]; y++) {
            bool side = abs(x - m[0]) == k || abs(y - m[1]) == k;
            double off2 = off_row2(soup, p, 0, x) + off_row2(soup, p, 1, y);
            for (int z = m[2] - k; z <= m[2] + k; z += side ? 1 : 2 * k)
                if (z >= 0 && z < size[2] && off2 + off_row2(soup, p, 2, z) <= s->distance2)
                    look_in_cell(soup, s, cell_index(soup, x, y, z));
        }
}

// How far a point may be and still lie in no cell outside the shell.
static double free_radius(const struct soup *soup, const struct looking *s, int shell) {
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

// Shell by shell, until it is known within how few cells the closest one lies.
bool soup_closest(struct soup *soup, const struct soup_search *search, struct soup_closest *out) {
    *out = (struct soup_closest){.index = MESH_NONE, .distance = search->within};
    if (!soup->count)
        return false;
    struct looking s = {search, out, faces_towards(search->facing, search->least), 0, {0}};
    const double *p = &search->point.x;
    for (int i = 0; i < 3; i++)
        s.middle[i] = cell_of(soup, p[i], i);
    next_stamp(soup);
    note_best(&s);
    if (search->hint < soup->count)
        look_at(soup, &s, search->hint);
    for (int k = 0;; k++) {
        look_in_shell(soup, &s, k);
        if (free_radius(soup, &s, k) > out->distance + SLACK_MM ||
            k > soup->size[0] + soup->size[1] + soup->size[2])
            break;
        if (out->distance < soup->cell) {
            look_around(soup, &s);
            break;
        }
    }
    return out->index != MESH_NONE;
}
