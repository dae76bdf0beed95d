#include "mesh/convex.h"

#include "base/check.h"

#include <string.h>

#define REACH_MM 1000.0 // of the box that is cut down to size
#define FAR_MM 100000.0 // of the one that finds where polyhedra farther away are
#define ON_MM 1e-7      // so near to a plane a vertex is on it
#define LEAST_MM3 1e-6

// Cutting a box of this reach down to size: its sides are faces CONVEX_PLANES_MAX and up, until
// planes have cut them all away.
#define FACES_MAX (CONVEX_PLANES_MAX + 6)
#define WORK_VERTICES (8 + 4 * FACES_MAX * 6)
#define LOOP_MAX (FACES_MAX + 2)

struct face_corners {
    int count;
    uint16_t corners[LOOP_MAX];
};

struct work {
    int vertex_count;
    vec3 vertices[WORK_VERTICES];
    struct face_corners faces[FACES_MAX]; // no corners: no face
    double side[WORK_VERTICES];           // of the plane at work: above 0 is outside, 0 is on it
    uint16_t next[WORK_VERTICES];         // around the new face
    int crossing_count;
    struct cut_edge {
        uint16_t inside, outside, vertex;
    } crossings[2 * LOOP_MAX];
};

static void start_with_box(struct work *w, double reach) {
    static const uint16_t sides[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                         {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    memset(w->faces, 0, sizeof w->faces);
    w->vertex_count = 8;
    for (int i = 0; i < 8; i++)
        w->vertices[i] =
            (vec3){i & 1 ? reach : -reach, i & 2 ? reach : -reach, i & 4 ? reach : -reach};
    for (int i = 0; i < 6; i++) {
        struct face_corners *face = &w->faces[CONVEX_PLANES_MAX + i];
        face->count = 4;
        memcpy(face->corners, sides[i], sizeof sides[i]);
    }
}

// ---- one plane ----------------------------------------------------------------------------------

// Of the vertices in use: whether one is outside, and whether one is inside.
static void take_sides(struct work *w, const struct plane *plane, bool *out_outside,
                       bool *out_inside) {
    *out_outside = *out_inside = false;
    for (int f = 0; f < FACES_MAX; f++)
        for (int i = 0; i < w->faces[f].count; i++) {
            uint16_t v = w->faces[f].corners[i];
            double side = vec3_dot(plane->normal, w->vertices[v]) - plane->offset;
            w->side[v] = fabs(side) <= ON_MM ? 0 : side;
            *out_outside |= w->side[v] > 0;
            *out_inside |= w->side[v] < 0;
        }
}

// Where the edge between two vertices meets the plane; both its faces get the same vertex.
static uint16_t cross(struct work *w, uint16_t inside, uint16_t outside) {
    if (w->side[inside] == 0)
        return inside;
    for (int i = 0; i < w->crossing_count; i++)
        if (w->crossings[i].inside == inside && w->crossings[i].outside == outside)
            return w->crossings[i].vertex;
    double t = w->side[inside] / (w->side[inside] - w->side[outside]);
    uint16_t vertex = (uint16_t)w->vertex_count++;
    CHECK(w->vertex_count <= WORK_VERTICES && w->crossing_count < 2 * LOOP_MAX);
    w->vertices[vertex] = vec3_lerp(w->vertices[inside], w->vertices[outside], t);
    w->crossings[w->crossing_count++] = (struct cut_edge){inside, outside, vertex};
    return vertex;
}

// What is left of a face; *out_leave and *out_return are where it leaves the inside and comes back.
// False where it does so more than once.
static bool clip_face(struct work *w, struct face_corners *face, uint16_t *out_leave,
                      uint16_t *out_return) {
    struct face_corners old = *face;
    int leaves = 0;
    face->count = 0;
    *out_leave = *out_return = 0;
    for (int i = 0; i < old.count; i++) {
        uint16_t a = old.corners[i], b = old.corners[(i + 1) % old.count];
        bool a_out = w->side[a] > 0, b_out = w->side[b] > 0;
        if (!a_out)
            face->corners[face->count++] = a;
        if (!a_out && b_out) {
            *out_leave = cross(w, a, b);
            leaves++;
            if (*out_leave != a)
                face->corners[face->count++] = *out_leave;
        } else if (a_out && !b_out) {
            *out_return = cross(w, b, a);
            if (*out_return != b)
                face->corners[face->count++] = *out_return;
        }
    }
    if (face->count < 3)
        face->count = 0;
    return leaves <= 1;
}

// The new face runs against the faces that it borders. False where that is not one loop.
static bool close_face(const struct work *w, uint16_t start, int border,
                       struct face_corners *out_face) {
    uint16_t at = start;
    out_face->count = 0;
    do {
        if (out_face->count == border || out_face->count == LOOP_MAX)
            return false;
        out_face->corners[out_face->count++] = at;
        at = w->next[at];
    } while (at != start);
    return out_face->count == border && border >= 3;
}

static bool cut_with(struct work *w, int plane) {
    uint16_t start = 0;
    int border = 0;
    w->crossing_count = 0;
    for (int f = 0; f < FACES_MAX; f++) {
        uint16_t leave, back;
        if (!clip_face(w, &w->faces[f], &leave, &back))
            return false;
        if (leave == back)
            continue;
        w->next[back] = leave;
        start = back;
        border++;
    }
    return close_face(w, start, border, &w->faces[plane]);
}

// ---- the result ---------------------------------------------------------------------------------

static double determinant(vec3 a, vec3 b, vec3 c) {
    return vec3_dot(a, vec3_cross(b, c));
}

// Where three planes meet.
static vec3 meet(const struct plane *a, const struct plane *b, const struct plane *c) {
    vec3 sum = vec3_scale(a->offset, vec3_cross(b->normal, c->normal));
    sum = vec3_add_scaled(sum, b->offset, vec3_cross(c->normal, a->normal));
    sum = vec3_add_scaled(sum, c->offset, vec3_cross(a->normal, b->normal));
    return vec3_scale(1 / determinant(a->normal, b->normal, c->normal), sum);
}

// A vertex anew, from the three of its planes that stand best to one another.
static vec3 sharpen(const struct convex *c, int vertex) {
    int faces[CONVEX_PLANES_MAX], count = 0;
    for (int f = 0; f < c->plane_count; f++)
        for (int i = c->first_corner[f]; i < c->first_corner[f + 1]; i++)
            if (c->corners[i] == vertex)
                faces[count++] = f;
    double best = 0;
    vec3 position = c->vertices[vertex];
    for (int i = 0; i < count; i++)
        for (int j = i + 1; j < count; j++)
            for (int k = j + 1; k < count; k++) {
                const struct plane *a = &c->planes[faces[i]], *b = &c->planes[faces[j]],
                                   *d = &c->planes[faces[k]];
                double size = fabs(determinant(a->normal, b->normal, d->normal));
                if (size <= best)
                    continue;
                best = size;
                position = meet(a, b, d);
            }
    return position;
}

static int face_with(const struct convex *c, int from, int to) {
    for (int f = 0; f < c->plane_count; f++) {
        int first = c->first_corner[f], end = c->first_corner[f + 1];
        for (int i = first; i < end; i++)
            if (c->corners[i] == from && c->corners[i + 1 < end ? i + 1 : first] == to)
                return f;
    }
    return -1;
}

static bool gather_edges(struct convex *c) {
    for (int f = 0; f < c->plane_count; f++) {
        int first = c->first_corner[f], end = c->first_corner[f + 1];
        for (int i = first; i < end; i++) {
            uint8_t a = c->corners[i], b = c->corners[i + 1 < end ? i + 1 : first];
            int other = face_with(c, b, a);
            if (other < 0)
                return false;
            if (a < b)
                c->edges[c->edge_count++] =
                    (struct convex_edge){{a, b}, (uint8_t)f, (uint8_t)other};
        }
    }
    return c->vertex_count - c->edge_count + c->plane_count == 2;
}

static void measure(struct convex *c) {
    vec3 origin = c->vertices[0];
    c->box = (struct box){origin, origin};
    for (int i = 0; i < c->vertex_count; i++) {
        vec3 p = c->vertices[i];
        c->box.min =
            (vec3){fmin(c->box.min.x, p.x), fmin(c->box.min.y, p.y), fmin(c->box.min.z, p.z)};
        c->box.max =
            (vec3){fmax(c->box.max.x, p.x), fmax(c->box.max.y, p.y), fmax(c->box.max.z, p.z)};
    }
    for (int f = 0; f < c->plane_count; f++) {
        int first = c->first_corner[f];
        vec3 a = vec3_sub(c->vertices[c->corners[first]], origin);
        for (int i = first + 1; i + 1 < c->first_corner[f + 1]; i++)
            c->volume += determinant(a, vec3_sub(c->vertices[c->corners[i]], origin),
                                     vec3_sub(c->vertices[c->corners[i + 1]], origin)) /
                         6;
    }
}

static bool gather(const struct work *w, const struct plane *planes, struct convex *c) {
    uint8_t names[WORK_VERTICES];
    int corners = 0;
    memset(c, 0, sizeof *c);
    memset(names, 0xff, sizeof names);
    for (int f = 0; f < CONVEX_PLANES_MAX; f++) {
        const struct face_corners *face = &w->faces[f];
        if (!face->count)
            continue;
        if (corners + face->count > 2 * CONVEX_EDGES_MAX)
            return false;
        c->planes[c->plane_count++] = planes[f];
        for (int i = 0; i < face->count; i++) {
            uint16_t v = face->corners[i];
            if (names[v] == 0xff) {
                if (c->vertex_count == CONVEX_VERTICES_MAX)
                    return false;
                names[v] = (uint8_t)c->vertex_count;
                c->vertices[c->vertex_count++] = w->vertices[v];
            }
            c->corners[corners++] = names[v];
        }
        c->first_corner[c->plane_count] = (uint16_t)corners;
    }
    if (!gather_edges(c))
        return false;
    for (int i = 0; i < c->vertex_count; i++)
        c->vertices[i] = sharpen(c, i);
    measure(c);
    return true;
}

static bool is_bounded(const struct work *w) {
    for (int f = CONVEX_PLANES_MAX; f < FACES_MAX; f++)
        if (w->faces[f].count)
            return false;
    return true;
}

static enum result take_planes(const struct plane *planes, int count, struct plane *out_planes,
                               struct error *err) {
    for (int i = 0; i < count; i++) {
        double length = vec3_length(planes[i].normal);
        if (!isfinite(length) || !isfinite(planes[i].offset))
            return fail(err, RESULT_INVALID, "plane %d has a number that is not finite", i);
        if (length < 1e-9)
            return fail(err, RESULT_INVALID, "plane %d has a normal without length", i);
        if (fabs(length - 1) < 1e-15)
            length = 1; // so that planes which were made so before come back as they are
        out_planes[i].normal = vec3_scale(1 / length, planes[i].normal);
        out_planes[i].offset = planes[i].offset / length;
    }
    return RESULT_OK;
}

// Cuts a box about the origin down to what the half-spaces have in common.
static enum result enclose(const struct plane *unit, int count, double reach, struct work *w,
                           struct error *err) {
    start_with_box(w, reach);
    for (int i = 0; i < count; i++) {
        bool outside, inside;
        take_sides(w, &unit[i], &outside, &inside);
        if (!inside)
            return fail(err, RESULT_INVALID,
                        "plane %d cuts away everything that the others enclose", i);
        if (outside && !cut_with(w, i))
            return fail(err, RESULT_INVALID, "plane %d is too near to others to be told apart", i);
    }
    if (!is_bounded(w))
        return fail(err, RESULT_INVALID, "the planes enclose nothing within %g m", reach / 1000);
    return RESULT_OK;
}

static vec3 middle_of(const struct work *w, double *out_radius) {
    vec3 sum = {0}, middle;
    int count = 0;
    for (int f = 0; f < FACES_MAX; f++)
        for (int i = 0; i < w->faces[f].count; i++, count++)
            sum = vec3_add(sum, w->vertices[w->faces[f].corners[i]]);
    middle = vec3_scale(1.0 / count, sum);
    *out_radius = 0;
    for (int f = 0; f < FACES_MAX; f++)
        for (int i = 0; i < w->faces[f].count; i++)
            *out_radius =
                fmax(*out_radius, vec3_distance(w->vertices[w->faces[f].corners[i]], middle));
    return middle;
}

// From coordinates about `middle`; the planes are those that were given.
static void move_back(const struct work *w, const struct plane *unit, vec3 middle,
                      struct convex *c) {
    for (int f = 0, kept = 0; f < CONVEX_PLANES_MAX; f++)
        if (w->faces[f].count)
            c->planes[kept++] = unit[f];
    for (int i = 0; i < c->vertex_count; i++)
        c->vertices[i] = vec3_add(c->vertices[i], middle);
    c->box = (struct box){vec3_add(c->box.min, middle), vec3_add(c->box.max, middle)};
}

static const char too_near[] = "the planes are too near to each other to be told apart";

// Where it is far from the origin, it is made about its own middle, as precisely as near it.
static enum result create_far(const struct plane *unit, int count, struct work *w,
                              struct convex *out_convex, struct error *err) {
    enum result result = enclose(unit, count, FAR_MM, w, err);
    if (result != RESULT_OK)
        return result;
    double radius;
    vec3 middle = middle_of(w, &radius);
    struct plane about[CONVEX_PLANES_MAX];
    for (int i = 0; i < count; i++)
        about[i] =
            (struct plane){unit[i].normal, unit[i].offset - vec3_dot(unit[i].normal, middle)};
    result = enclose(about, count, fmax(REACH_MM, 2 * radius), w, err);
    if (result != RESULT_OK)
        return result;
    if (!gather(w, about, out_convex))
        return fail(err, RESULT_INVALID, too_near);
    move_back(w, unit, middle, out_convex);
    return RESULT_OK;
}

enum result convex_create(const struct plane *planes, int count, struct convex *out_convex,
                          struct error *err) {
    if (count < 4 || count > CONVEX_PLANES_MAX)
        return fail(err, RESULT_INVALID, "%d planes, where a convex polyhedron has 4 to %d", count,
                    CONVEX_PLANES_MAX);
    struct plane unit[CONVEX_PLANES_MAX];
    enum result result = take_planes(planes, count, unit, err);
    if (result != RESULT_OK)
        return result;
    struct work work;
    if (enclose(unit, count, REACH_MM, &work, NULL) != RESULT_OK)
        result = create_far(unit, count, &work, out_convex, err);
    else if (!gather(&work, unit, out_convex))
        result = fail(err, RESULT_INVALID, too_near);
    if (result == RESULT_OK && out_convex->volume < LEAST_MM3)
        result = fail(err, RESULT_INVALID, "the planes enclose %g mm3 only", out_convex->volume);
    return result;
}

void convex_supports(const vec3 *points, int point_count, const vec3 *normals, int normal_count,
                     struct plane *out_planes) {
    for (int i = 0; i < normal_count; i++) {
        double farthest = -INFINITY;
        for (int k = 0; k < point_count; k++)
            farthest = fmax(farthest, vec3_dot(normals[i], points[k]));
        out_planes[i] = (struct plane){normals[i], farthest};
    }
}

bool convex_contains(const struct convex *convex, vec3 p) {
    for (int i = 0; i < convex->plane_count; i++)
        if (vec3_dot(convex->planes[i].normal, p) > convex->planes[i].offset)
            return false;
    return true;
}
