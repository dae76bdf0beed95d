#include "mesh/cluster.h"

#include "base/check.h"
#include "mesh/eights.h"

#include <stdlib.h>
#include <string.h>

// ---- making ----

static double inverse(double value) {
    return value > 0 ? 1 / value : 0;
}

static void set3(cluster_lanes out[3], int lane, vec3 v) {
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

static void fill_lane(struct cluster *cluster, int lane, const struct mesh *mesh,
                      uint32_t triangle) {
    int first = first_corner(mesh, triangle);
    vec3 a = mesh_corner(mesh, triangle, first);
    vec3 ab = vec3_sub(mesh_corner(mesh, triangle, (first + 1) % 3), a);
    vec3 ac = vec3_sub(mesh_corner(mesh, triangle, (first + 2) % 3), a);
    vec3 x = vec3_unit_or(ab, (vec3){1, 0, 0});
    vec3 z = vec3_unit_or(vec3_cross(ab, ac), any_normal_to(x));
    vec3 y = vec3_cross(z, x);
    double b_x = vec3_dot(x, ab), c_x = vec3_dot(x, ac), c_y = vec3_dot(y, ac);
    set3(cluster->a, lane, a);
    set3(cluster->x, lane, x);
    set3(cluster->y, lane, y);
    set3(cluster->z, lane, z);
    cluster->b_x[lane] = (float)b_x;
    cluster->c_x[lane] = (float)c_x;
    cluster->c_y[lane] = (float)c_y;
    cluster->inv_ac[lane] = (float)inverse(c_x * c_x + c_y * c_y);
    cluster->inv_bc[lane] = (float)inverse((c_x - b_x) * (c_x - b_x) + c_y * c_y);
}

static void fill_cluster(struct cluster *cluster, const struct mesh *mesh,
                         const struct eights_item *items, uint32_t count) {
    for (uint32_t i = 0; i < CLUSTER_SIZE; i++) {
        cluster->triangles[i] = items[i < count ? i : count - 1].number;
        fill_lane(cluster, (int)i, mesh, cluster->triangles[i]);
    }
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

static void make_clusters(struct cluster_tree *tree, const struct mesh *mesh) {
    uint32_t count = mesh->triangle_count;
    struct eights_item *items = alloc(count, sizeof *items);
    float *middles = triangle_middles(mesh);
    eights_order(middles, count, items);
    tree->counts[0] = eights_count(count);
    tree->clusters = alloc_aligned(64, tree->counts[0] * sizeof *tree->clusters);
    for (uint32_t i = 0; i < tree->counts[0]; i++) {
        uint32_t first = i * CLUSTER_SIZE, left = count - first;
        fill_cluster(&tree->clusters[i], mesh, items + first,
                     left < CLUSTER_SIZE ? left : CLUSTER_SIZE);
    }
    free(middles);
    free(items);
}

// ---- boxes ----

static void widen(struct cluster_boxes *boxes, uint32_t lane, const float low[3],
                  const float high[3]) {
    for (int axis = 0; axis < 3; axis++) {
        boxes->low[axis][lane] = fminf(boxes->low[axis][lane], low[axis]);
        boxes->high[axis][lane] = fmaxf(boxes->high[axis][lane], high[axis]);
    }
}

static struct cluster_boxes *empty_boxes(uint32_t blocks) {
    struct cluster_boxes *boxes = alloc_aligned(64, blocks * sizeof *boxes);
    for (uint32_t i = 0; i < blocks; i++)
        for (int k = 0; k < 3 * CLUSTER_SIZE; k++) {
            boxes[i].low[k / CLUSTER_SIZE][k % CLUSTER_SIZE] = INFINITY;
            boxes[i].high[k / CLUSTER_SIZE][k % CLUSTER_SIZE] = -INFINITY;
        }
    return boxes;
}

static void box_clusters(struct cluster_tree *tree, const struct mesh *mesh) {
    for (uint32_t i = 0; i < 3 * CLUSTER_SIZE * (size_t)tree->counts[0]; i++) {
        uint32_t cluster = i / (3 * CLUSTER_SIZE), corner = i % (3 * CLUSTER_SIZE);
        uint32_t triangle = tree->clusters[cluster].triangles[corner / 3];
        uint32_t vertex = mesh->triangles[3 * (size_t)triangle + corner % 3];
        const float *p = mesh->positions + 3 * (size_t)vertex;
        widen(&tree->levels[0][cluster / CLUSTER_SIZE], cluster % CLUSTER_SIZE, p, p);
    }
}

static void box_boxes(struct cluster_tree *tree, int level) {
    for (uint32_t i = 0; i < tree->counts[level - 1]; i++) {
        const struct cluster_boxes *below = &tree->levels[level - 1][i / CLUSTER_SIZE];
        uint32_t lane = i % CLUSTER_SIZE, box = i / CLUSTER_SIZE;
        const float low[3] = {below->low[0][lane], below->low[1][lane], below->low[2][lane]};
        const float high[3] = {below->high[0][lane], below->high[1][lane], below->high[2][lane]};
        widen(&tree->levels[level][box / CLUSTER_SIZE], box % CLUSTER_SIZE, low, high);
    }
}

void cluster_tree_init(struct cluster_tree *tree, const struct mesh *mesh) {
    *tree = (struct cluster_tree){0};
    make_clusters(tree, mesh);
    for (int level = 0; level == 0 || tree->counts[level - 1] > CLUSTER_SIZE; level++) {
        CHECK(level < CLUSTER_LEVELS_MAX);
        if (level > 0)
            tree->counts[level] = eights_count(tree->counts[level - 1]);
        tree->levels[level] = empty_boxes(eights_count(tree->counts[level]));
        tree->level_count = level + 1;
        if (level == 0)
            box_clusters(tree, mesh);
        else
            box_boxes(tree, level);
    }
}

void cluster_tree_fini(struct cluster_tree *tree) {
    for (int level = 0; level < tree->level_count; level++)
        free(tree->levels[level]);
    free(tree->clusters);
    *tree = (struct cluster_tree){0};
}
