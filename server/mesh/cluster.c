#include "mesh/cluster.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

// ---- making ----

static double inverse(double value) {
    return value > 0 ? 1 / value : 0;
}

static void set3(lanes out[3], int lane, vec3 v) {
    out[0][lane] = (float)v.x;
    out[1][lane] = (float)v.y;
    out[2][lane] = (float)v.z;
}

static vec3 any_normal_to(vec3 unit) {
    vec3 axis = fabs(unit.x) < 0.6 ? (vec3){1, 0, 0} : (vec3){0, 1, 0};
    return vec3_unit_or(vec3_cross(unit, axis), (vec3){0, 0, 1});
}

// Its corner where the longest side begins, so that the frame is as good as rounding allows even
// for needles.
static int first_corner(const struct mesh *mesh, uint32_t triangle) {
    int first = 0;
    double longest = -1;
    for (int i = 0; i < 3; i++) {
        double length =
            vec3_distance(mesh_corner(mesh, triangle, i), mesh_corner(mesh, triangle, (i + 1) % 3));
        if (length > longest) {
            longest = length;
            first = i;
        }
    }
    return first;
}

static void fill_lane(struct cluster_block *block, int lane, const struct mesh *mesh,
                      uint32_t triangle) {
    int first = first_corner(mesh, triangle);
    vec3 a = mesh_corner(mesh, triangle, first);
    vec3 ab = vec3_sub(mesh_corner(mesh, triangle, (first + 1) % 3), a);
    vec3 ac = vec3_sub(mesh_corner(mesh, triangle, (first + 2) % 3), a);
    vec3 x = vec3_unit_or(ab, (vec3){1, 0, 0});
    vec3 z = vec3_unit_or(vec3_cross(ab, ac), any_normal_to(x));
    vec3 y = vec3_cross(z, x);
    double b_x = vec3_dot(x, ab), c_x = vec3_dot(x, ac), c_y = vec3_dot(y, ac);
    set3(block->a, lane, a);
    set3(block->x, lane, x);
    set3(block->y, lane, y);
    set3(block->z, lane, z);
    block->b_x[lane] = (float)b_x;
    block->c_x[lane] = (float)c_x;
    block->c_y[lane] = (float)c_y;
    block->inv_ac[lane] = (float)inverse(c_x * c_x + c_y * c_y);
    block->inv_bc[lane] = (float)inverse((c_x - b_x) * (c_x - b_x) + c_y * c_y);
}

static void fill_box(struct cluster *cluster, const struct mesh *mesh) {
    for (int axis = 0; axis < 3; axis++) {
        cluster->low[axis] = INFINITY;
        cluster->high[axis] = -INFINITY;
    }
    for (int i = 0; i < 3 * CLUSTER_SIZE; i++) {
        uint32_t vertex = mesh->triangles[3 * (size_t)cluster->triangles[i / 3] + (size_t)i % 3];
        const float *p = mesh->positions + 3 * (size_t)vertex;
        for (int axis = 0; axis < 3; axis++) {
            cluster->low[axis] = fminf(cluster->low[axis], p[axis]);
            cluster->high[axis] = fmaxf(cluster->high[axis], p[axis]);
        }
    }
}

struct placed {
    float at; // along the axis that is looked at
    uint32_t triangle;
};

static void fill_cluster(struct cluster *cluster, const struct mesh *mesh,
                         const struct placed *placed, uint32_t count) {
    for (uint32_t i = 0; i < CLUSTER_SIZE; i++) {
        cluster->triangles[i] = placed[i < count ? i : count - 1].triangle;
        fill_lane(&cluster->blocks[i / LANES], (int)(i % LANES), mesh, cluster->triangles[i]);
    }
    fill_box(cluster, mesh);
}

struct splitter {
    const struct mesh *mesh;
    const float *middles; // 3 for each triangle
    struct cluster *clusters;
    uint32_t count;
    uint32_t random; // pivots are drawn: rows of equal or sorted triangles take no longer
};

static int widest_axis(const struct splitter *s, const struct placed *placed, uint32_t count) {
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < count; i++)
        for (int axis = 0; axis < 3; axis++) {
            float value = s->middles[3 * (size_t)placed[i].triangle + (size_t)axis];
            low[axis] = fminf(low[axis], value);
            high[axis] = fmaxf(high[axis], value);
        }
    int widest = 0;
    for (int axis = 1; axis < 3; axis++)
        if (high[axis] - low[axis] > high[widest] - low[widest])
            widest = axis;
    return widest;
}

static bool is_before(struct placed a, struct placed b) {
    return a.at != b.at ? a.at < b.at : a.triangle < b.triangle;
}

static void exchange(struct placed *a, struct placed *b) {
    struct placed kept = *a;
    *a = *b;
    *b = kept;
}

// Brings the `left` first of them to the front (Hoare 1961).
static void part(struct splitter *s, struct placed *placed, uint32_t count, uint32_t left) {
    uint32_t from = 0, to = count; // the first of the others lies there
    while (to - from > 1) {
        s->random = s->random * 1664525 + 1013904223;
        exchange(&placed[from + s->random % (to - from)], &placed[to - 1]);
        uint32_t before = from;
        for (uint32_t i = from; i + 1 < to; i++)
            if (is_before(placed[i], placed[to - 1]))
                exchange(&placed[i], &placed[before++]);
        exchange(&placed[before], &placed[to - 1]);
        if (before == left)
            return;
        *(before < left ? &from : &to) = before < left ? before + 1 : before;
    }
}

// Halves along the widest axis, the left half a whole number of clusters.
static void split(struct splitter *s, struct placed *placed, uint32_t count) {
    if (count <= CLUSTER_SIZE) {
        fill_cluster(&s->clusters[s->count++], s->mesh, placed, count);
        return;
    }
    int axis = widest_axis(s, placed, count);
    for (uint32_t i = 0; i < count; i++)
        placed[i].at = s->middles[3 * (size_t)placed[i].triangle + (size_t)axis];
    uint32_t clusters = (count + CLUSTER_SIZE - 1) / CLUSTER_SIZE;
    uint32_t left = clusters / 2 * CLUSTER_SIZE;
    part(s, placed, count, left);
    split(s, placed, left);
    split(s, placed + left, count - left);
}

static float *triangle_middles(const struct mesh *mesh) {
    float *middles = alloc(3 * (size_t)mesh->triangle_count, sizeof *middles);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 sum = vec3_add(vec3_add(mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1)),
                            mesh_corner(mesh, t, 2));
        middles[3 * (size_t)t] = (float)(sum.x / 3);
        middles[3 * (size_t)t + 1] = (float)(sum.y / 3);
        middles[3 * (size_t)t + 2] = (float)(sum.z / 3);
    }
    return middles;
}

struct cluster *clusters_create(const struct mesh *mesh, uint32_t *out_count) {
    size_t most = ((size_t)mesh->triangle_count + CLUSTER_SIZE - 1) / CLUSTER_SIZE;
    struct cluster *clusters = alloc_aligned(64, most * sizeof *clusters);
    struct placed *placed = alloc(mesh->triangle_count, sizeof *placed);
    float *middles = triangle_middles(mesh);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        placed[t].triangle = t;
    struct splitter splitter = {mesh, middles, clusters, 0, 1};
    split(&splitter, placed, mesh->triangle_count);
    free(middles);
    free(placed);
    *out_count = splitter.count;
    return clusters;
}

// ---- measuring ----

static inline lanes spread(float value) {
    return (lanes){value, value, value, value};
}

static inline lanes choose(lane_mask mask, lanes yes, lanes no) {
    return (lanes)((mask & (lane_mask)yes) | (~mask & (lane_mask)no));
}

static inline lanes smaller(lanes a, lanes b) {
    return choose(a < b, a, b);
}

static inline lanes clamp(lanes value, lanes most) {
    value = choose(value > 0.0f, value, spread(0));
    return choose(value < most, value, most);
}

static inline lanes dot(const lanes a[3], const lanes b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// From (x, y) to the side from the origin to (to_x, to_y), in the plane.
static inline lanes square_to_side(lanes x, lanes y, lanes to_x, lanes to_y, lanes inv_square) {
    lanes t = clamp((x * to_x + y * to_y) * inv_square, spread(1));
    lanes off_x = x - t * to_x, off_y = y - t * to_y;
    return off_x * off_x + off_y * off_y;
}

static inline lanes block_squares(const struct cluster_block *block, const float p[3]) {
    lanes ap[3] = {spread(p[0]) - block->a[0], spread(p[1]) - block->a[1],
                   spread(p[2]) - block->a[2]};
    lanes x = dot(block->x, ap), y = dot(block->y, ap), z = dot(block->z, ap);
    lanes from_b = x - block->b_x, bc_x = block->c_x - block->b_x;
    lanes off_ab = x - clamp(x, block->b_x);
    lanes square = off_ab * off_ab + y * y;
    square = smaller(square, square_to_side(x, y, block->c_x, block->c_y, block->inv_ac));
    square = smaller(square, square_to_side(from_b, y, bc_x, block->c_y, block->inv_bc));
    lane_mask inside =
        (y > 0.0f) & (bc_x * y > block->c_y * from_b) & (block->c_y * x > block->c_x * y);
    return choose(inside, spread(0), square) + z * z;
}

void cluster_distances(const struct cluster *cluster, const float p[3],
                       float out_squares[CLUSTER_SIZE]) {
    for (int i = 0; i < CLUSTER_BLOCKS; i++) {
        lanes squares = block_squares(&cluster->blocks[i], p);
        memcpy(out_squares + i * LANES, &squares, sizeof squares);
    }
}
