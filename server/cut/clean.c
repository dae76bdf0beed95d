#include "cut/clean.h"

#include "cut/surgery.h"

#include <stdlib.h>

// The surface may sink more than it may rise: a wall that rises by more than blades grow would be
// left as a skin by a bite that is flush with it from behind.
#define NEAR_MM 1e-3      // a vertex merges into one as near as this
#define NEAR_SINK_MM 1e-4 // where that sinks the surface by no more than this,
#define SINK_MM 1e-6      // and into any other where it sinks it by no more than this
#define RISE_MM 1e-7
#define SAME_MM 1e-8 // vertices as near as this are one: what is as flat beside them may turn
#define THIN 0.1     // ratio of height to length: triangles do not get thinner than that
#define DEGREE_MAX 64
#define TURNS 8 // of the queue

void cleaner_fini(struct cleaner *cleaner) {
    stamped_set_fini(&cleaner->touched);
    stamped_set_fini(&cleaner->queued);
    ids_fini(&cleaner->queue);
    stamped_set_fini(&cleaner->shaped);
    free(cleaner->shapes);
}

// Only what the cut has touched, so that cleaning does not creep away from it.
static void queue(struct cut_mesh *mesh, uint32_t vertex) {
    struct cleaner *cleaner = mesh->scratch->cleaner;
    if (!stamped_set_has(&cleaner->touched, vertex) || stamped_set_has(&cleaner->queued, vertex))
        return;
    stamped_set_put(&cleaner->queued, vertex, 0);
    ids_push(&cleaner->queue, vertex);
}

// ---- a vertex and what is around it ----

struct fan {
    int count;
    uint32_t sides[DEGREE_MAX]; // that start at the vertex, clockwise: beside side k lie triangles
                                // k, k + 1
    struct triangle_shape shapes[DEGREE_MAX]; // of their triangles
    uint32_t labels[DEGREE_MAX];
    double thinnest;
};

static double thinness(vec3 a, vec3 b, vec3 c, vec3 *out_normal) {
    vec3 ab = vec3_sub(b, a), bc = vec3_sub(c, b), ca = vec3_sub(a, c);
    double longest = higher(vec3_dot(ab, ab), higher(vec3_dot(bc, bc), vec3_dot(ca, ca)));
    *out_normal = vec3_cross(ab, vec3_sub(c, a));
    return longest > 0 ? vec3_length(*out_normal) / longest : 0;
}

// A triangle is seen from each of its corners.
static struct triangle_shape shape_of(const struct cut_mesh *mesh, uint32_t triangle) {
    struct cleaner *cleaner = mesh->scratch->cleaner;
    if (stamped_set_has(&cleaner->shaped, triangle))
        return cleaner->shapes[stamped_set_get(&cleaner->shaped, triangle)];
    vec3 p[3];
    struct triangle_shape shape;
    triangle_points(mesh, mesh->corners + 3 * (size_t)triangle, p);
    shape.thinness = thinness(p[0], p[1], p[2], &shape.normal);
    shape.length = vec3_length(shape.normal);
    shape.height = sqrt(shape.thinness * shape.length);
    stamped_set_put(&cleaner->shaped, triangle, cleaner->shape_count);
    cleaner->shapes = array_grow(cleaner->shapes, &cleaner->shape_room, cleaner->shape_count + 1,
                                 sizeof *cleaner->shapes);
    cleaner->shapes[cleaner->shape_count++] = shape;
    return shape;
}

static void forget_shape(struct cut_mesh *mesh, uint32_t triangle) {
    stamped_set_remove(&mesh->scratch->cleaner->shaped, triangle);
}

static int after(const struct fan *fan, int k) {
    return k + 1 < fan->count ? k + 1 : 0;
}

static bool gather_fan(const struct cut_mesh *mesh, uint32_t vertex, struct fan *fan) {
    uint32_t first = mesh->vertex_sides[vertex], side = first;
    fan->count = 0;
    fan->thinnest = 1;
    do {
        if (fan->count == DEGREE_MAX)
            return false;
        fan->shapes[fan->count] = shape_of(mesh, side / 3);
        fan->labels[fan->count] = mesh->labels[side / 3];
        fan->thinnest = lower(fan->thinnest, fan->shapes[fan->count].thinness);
        fan->sides[fan->count++] = side;
        side = side_around(mesh, side);
    } while (side != first);
    return true;
}

// ---- merging a vertex into a neighbour ----

// Where the surface has labels, a line between two of them goes on as the line that it was: on each
// way around the vertex from the side that goes to it, the label of the triangle that goes,
// changing once at most.
static bool keeps_labels(const struct fan *fan, int k) {
    uint32_t right = fan->labels[after(fan, k)], left = fan->labels[k];
    bool changed = false;
    for (int i = 2, f = after(fan, k); i < fan->count; i++) {
        f = after(fan, f);
        changed |= fan->labels[f] != right;
        if (fan->labels[f] != (changed ? left : right))
            return false;
    }
    return true;
}

struct merge_limits {
    double sink;  // mm
    double flat;  // mm: triangles that are not higher are not asked
    double least; // a thinner triangle ends it
};

// The thinnest triangle after merging; -1 where it passes a limit or the surface would turn over.
static double merged_thinness(const struct cut_mesh *mesh, const struct fan *fan, int k, vec3 from,
                              vec3 to, struct merge_limits limits) {
    double thinnest = 1;
    for (int i = 2, f = after(fan, k); i < fan->count; i++) {
        f = after(fan, f);
        if (fan->shapes[f].height <= limits.flat)
            continue;
        vec3 normal = fan->shapes[f].normal, turned;
        double rise = vec3_dot(normal, vec3_sub(to, from)), length = fan->shapes[f].length;
        if (rise > RISE_MM * length || rise < -limits.sink * length)
            return -1;
        uint32_t side = fan->sides[f];
        double thin = thinness(to, mesh->points[side_end(mesh, side)],
                               mesh->points[mesh->corners[side_previous(side)]], &turned);
        if (thin < limits.least || !(vec3_dot(normal, turned) > 0.5 * length * vec3_length(turned)))
            return -1;
        thinnest = lower(thinnest, thin);
    }
    return thinnest;
}

// How good a merge into neighbour k is: 2 where both are one, else the thinnest triangle after it;
// -1 where it must not be, or is worse than `least`.
static double judge(const struct cut_mesh *mesh, const struct fan *fan, int k, vec3 from,
                    double least) {
    vec3 to = mesh->points[side_end(mesh, fan->sides[k])];
    double distance = vec3_distance(from, to);
    if (distance < SAME_MM) {
        struct merge_limits same = {SAME_MM, 4 * SAME_MM, 0};
        return merged_thinness(mesh, fan, k, from, to, same) < 0 ? -1 : 2;
    }
    bool near = fan->count > 3 && distance < NEAR_MM;
    if (!near && !keeps_labels(fan, k))
        return -1;
    struct merge_limits limits = {near ? NEAR_SINK_MM : SINK_MM, -1, least};
    return merged_thinness(mesh, fan, k, from, to, limits);
}

// The best neighbour to merge into, as an index of the fan; -1: none.
static int choose_neighbour(const struct cut_mesh *mesh, uint32_t vertex, const struct fan *fan) {
    int best = -1;
    double least = lower(fan->thinnest, THIN);
    for (int k = 0; k < fan->count; k++) {
        double good = judge(mesh, fan, k, mesh->points[vertex], least);
        if (good < least || !surgery_can_merge(mesh, fan->sides[k]))
            continue;
        best = k;
        least = good;
    }
    return best;
}

static bool merge_vertex(struct cut_mesh *mesh, uint32_t vertex, const struct fan *fan) {
    if (vertex < mesh->original_count)
        return false;
    int k = choose_neighbour(mesh, vertex, fan);
    if (k < 0)
        return false;
    for (int i = 0; i < fan->count; i++) {
        queue(mesh, side_end(mesh, fan->sides[i]));
        forget_shape(mesh, fan->sides[i] / 3);
    }
    surgery_merge(mesh, fan->sides[k]);
    return true;
}

// ---- flat triangles: the long side turns ----

// Whether the triangle across the side p q from the vertex can take it in: the vertex lies on the
// side, between its ends.
static bool lies_on(vec3 p, vec3 q, vec3 v) {
    vec3 pq = vec3_sub(q, p), pv = vec3_sub(v, p);
    double along = vec3_dot(pq, pv), square = vec3_dot(pq, pq);
    if (!(along > 0 && along < square))
        return false;
    vec3 off = vec3_cross(pq, pv);
    return vec3_dot(off, off) <= SINK_MM * SINK_MM * square;
}

static bool is_touched(const struct cut_mesh *mesh, uint32_t vertex) {
    return stamped_set_has(&mesh->scratch->cleaner->touched, vertex);
}

static bool flip(struct cut_mesh *mesh, uint32_t vertex, const struct fan *fan) {
    vec3 v = mesh->points[vertex];
    for (int i = 0; i < fan->count; i++) {
        uint32_t side = side_next(fan->sides[i]), twin = mesh->twins[side];
        uint32_t p = mesh->corners[side], q = side_end(mesh, side);
        uint32_t r = mesh->corners[side_previous(twin)];
        vec3 at_p = mesh->points[p], at_q = mesh->points[q];
        if (!lies_on(at_p, at_q, v) || (!is_touched(mesh, p) && !is_touched(mesh, q)) ||
            !surgery_can_flip(mesh, side))
            continue;
        vec3 at_r = mesh->points[r];
        vec3 before, left, right, flat;
        double thin = thinness(at_q, at_p, at_r, &before);
        thin = lower(thin, thinness(v, at_p, at_q, &flat));
        double thin_after = lower(thinness(v, at_p, at_r, &left), thinness(v, at_r, at_q, &right));
        if (!(thin_after > thin && vec3_dot(before, left) > 0 && vec3_dot(before, right) > 0 &&
              vec3_dot(before, vec3_sub(v, at_p)) <= RISE_MM * vec3_length(before)))
            continue;
        surgery_flip(mesh, side);
        forget_shape(mesh, side / 3);
        forget_shape(mesh, twin / 3);
        queue(mesh, vertex);
        queue(mesh, p);
        queue(mesh, q);
        queue(mesh, r);
        return true;
    }
    return false;
}

// ---- all ----

void clean(struct cut_mesh *mesh) {
    struct cleaner *cleaner = mesh->scratch->cleaner;
    cleaner->queue.count = cleaner->shape_count = 0;
    stamped_set_begin(&cleaner->shaped, mesh->triangle_room);
    stamped_set_begin(&cleaner->touched, mesh->vertex_room);
    stamped_set_begin(&cleaner->queued, mesh->vertex_room);
    for (uint32_t i = 0; i < mesh->scratch->undo.vertex_count; i++) {
        uint32_t vertex = mesh->scratch->undo.vertices[i].id;
        stamped_set_put(&cleaner->touched, vertex, 0);
        if (cut_mesh_vertex_alive(mesh, vertex))
            queue(mesh, vertex);
    }
    ids_sort(&cleaner->queue);
    uint32_t limit = TURNS * cleaner->queue.count;
    struct fan fan;
    for (uint32_t next = 0; next < cleaner->queue.count && next < limit; next++) {
        uint32_t vertex = cleaner->queue.at[next];
        stamped_set_remove(&cleaner->queued, vertex);
        if (!cut_mesh_vertex_alive(mesh, vertex) || !gather_fan(mesh, vertex, &fan))
            continue;
        if (!flip(mesh, vertex, &fan))
            merge_vertex(mesh, vertex, &fan);
    }
}
