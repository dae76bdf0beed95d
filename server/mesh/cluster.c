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

static void fill_lane(struct cluster_block *b, int lane, const struct mesh *mesh,
                      uint32_t triangle) {
    vec3 a = mesh_corner(mesh, triangle, 0);
    vec3 ab = vec3_sub(mesh_corner(mesh, triangle, 1), a);
    vec3 ac = vec3_sub(mesh_corner(mesh, triangle, 2), a);
    vec3 bc = vec3_sub(ac, ab), cross = vec3_cross(ab, ac);
    double abab = vec3_dot(ab, ab), abac = vec3_dot(ab, ac), acac = vec3_dot(ac, ac);
    double inv_det = inverse(vec3_dot(cross, cross));
    set3(b->a, lane, a);
    set3(b->ab, lane, ab);
    set3(b->ac, lane, ac);
    set3(b->normal, lane, vec3_unit_or(cross, (vec3){0, 0, 0}));
    b->s_ab[lane] = (float)(acac * inv_det);
    b->s_ac[lane] = (float)(abac * inv_det);
    b->t_ac[lane] = (float)(abab * inv_det);
    // A triangle without area has no plane: its edges alone count.
    b->slack[lane] = inv_det > 0 ? (float)(1e-5 + 4e-6 * abab * acac * inv_det) : -1;
    b->inv_ab[lane] = (float)inverse(abab);
    b->inv_ac[lane] = (float)inverse(acac);
    b->inv_bc[lane] = (float)inverse(vec3_dot(bc, bc));
    b->bc_offset[lane] = (float)(abab - abac);
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

static void fill_cluster(struct cluster *cluster, const struct mesh *mesh,
                         const uint32_t *triangles, uint32_t count) {
    for (uint32_t i = 0; i < CLUSTER_SIZE; i++) {
        cluster->triangles[i] = triangles[i < count ? i : count - 1];
        fill_lane(&cluster->blocks[i / LANES], (int)(i % LANES), mesh, cluster->triangles[i]);
    }
    fill_box(cluster, mesh);
}

struct splitter {
    const struct mesh *mesh;
    const float *middles; // 3 for each triangle
    struct cluster *clusters;
    uint32_t count;
};

static int widest_axis(const struct splitter *s, const uint32_t *triangles, uint32_t count) {
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < count; i++)
        for (int axis = 0; axis < 3; axis++) {
            float value = s->middles[3 * (size_t)triangles[i] + (size_t)axis];
            low[axis] = fminf(low[axis], value);
            high[axis] = fmaxf(high[axis], value);
        }
    int widest = 0;
    for (int axis = 1; axis < 3; axis++)
        if (high[axis] - low[axis] > high[widest] - low[widest])
            widest = axis;
    return widest;
}

struct sort_key {
    const float *middles;
    int axis;
};

static int compare_middles(const void *a, const void *b, void *user) {
    const struct sort_key *key = user;
    uint32_t i = *(const uint32_t *)a, k = *(const uint32_t *)b;
    float x = key->middles[3 * (size_t)i + (size_t)key->axis];
    float y = key->middles[3 * (size_t)k + (size_t)key->axis];
    if (x != y)
        return x < y ? -1 : 1;
    return i < k ? -1 : i > k;
}

// Halves along the widest axis, the left half a whole number of clusters.
static void split(struct splitter *s, uint32_t *triangles, uint32_t count) {
    if (count <= CLUSTER_SIZE) {
        fill_cluster(&s->clusters[s->count++], s->mesh, triangles, count);
        return;
    }
    struct sort_key key = {s->middles, widest_axis(s, triangles, count)};
    qsort_r(triangles, count, sizeof *triangles, compare_middles, &key);
    uint32_t clusters = (count + CLUSTER_SIZE - 1) / CLUSTER_SIZE;
    uint32_t left = clusters / 2 * CLUSTER_SIZE;
    split(s, triangles, left);
    split(s, triangles + left, count - left);
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
    struct cluster *clusters = aligned_alloc(64, (most * sizeof *clusters + 63) / 64 * 64);
    uint32_t *triangles = alloc(mesh->triangle_count, sizeof *triangles);
    float *middles = triangle_middles(mesh);
    CHECK(clusters);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        triangles[t] = t;
    struct splitter splitter = {mesh, middles, clusters, 0};
    split(&splitter, triangles, mesh->triangle_count);
    free(middles);
    free(triangles);
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

static inline lanes clamp01(lanes x) {
    x = choose(x > 0.0f, x, spread(0));
    return choose(x < 1.0f, x, spread(1));
}

static inline lanes dot(const lanes a[3], const lanes b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// |v − u e|²
static inline lanes square_off_edge(const lanes v[3], lanes u, const lanes e[3]) {
    lanes r[3] = {v[0] - u * e[0], v[1] - u * e[1], v[2] - u * e[2]};
    return dot(r, r);
}

static inline lanes block_squares(const struct cluster_block *b, const float p[3]) {
    lanes ap[3], bp[3], bc[3];
    for (int i = 0; i < 3; i++) {
        ap[i] = spread(p[i]) - b->a[i];
        bp[i] = ap[i] - b->ab[i];
        bc[i] = b->ac[i] - b->ab[i];
    }
    lanes along_ab = dot(b->ab, ap), along_ac = dot(b->ac, ap);
    lanes square = square_off_edge(ap, clamp01(along_ab * b->inv_ab), b->ab);
    square = smaller(square, square_off_edge(ap, clamp01(along_ac * b->inv_ac), b->ac));
    lanes along_bc = (along_ac - along_ab + b->bc_offset) * b->inv_bc;
    square = smaller(square, square_off_edge(bp, clamp01(along_bc), bc));

    lanes s = b->s_ab * along_ab - b->s_ac * along_ac;
    lanes t = b->t_ac * along_ac - b->s_ac * along_ab;
    lanes height = dot(b->normal, ap);
    lane_mask inside =
        (s >= -b->slack) & (t >= -b->slack) & (s + t <= 1.0f + b->slack) & (b->slack > 0.0f);
    return choose(inside, height * height, square);
}

void cluster_distances(const struct cluster *cluster, const float p[3],
                       float out_squares[CLUSTER_SIZE]) {
    for (int i = 0; i < CLUSTER_BLOCKS; i++) {
        lanes squares = block_squares(&cluster->blocks[i], p);
        memcpy(out_squares + i * LANES, &squares, sizeof squares);
    }
}
