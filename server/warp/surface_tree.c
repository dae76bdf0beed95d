#include "warp/surface_tree.h"

#include "base/check.h"

#include <stdlib.h>

// ---- pieces -------------------------------------------------------------------------------------

// Over a triangle ∫ s sᵀ dA = A/12 Σ s sᵀ, summed over its corners.
struct surface_piece surface_triangle(const vec3 corners[3]) {
    vec3 sum = vec3_add(vec3_add(corners[0], corners[1]), corners[2]);
    vec3 normal = vec3_cross(vec3_sub(corners[1], corners[0]), vec3_sub(corners[2], corners[0]));
    struct surface_piece piece = {vec3_scale(1.0 / 3, sum), 0.5 * vec3_length(normal), 0, {{{0}}}};
    double square = 0;
    for (int i = 0; i < 3; i++) {
        vec3 s = vec3_sub(corners[i], piece.centre);
        surface_add_outer(&piece.spread, piece.area / 12, s, s);
        square = fmax(square, vec3_dot(s, s));
    }
    piece.radius = sqrt(square);
    return piece;
}

static void corners_of(const struct surface_tree *tree, uint32_t place, vec3 out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = mesh_corner(tree->mesh, tree->order[place], i);
}

int surface_pieces(const struct surface_tree *tree, uint32_t index,
                   struct surface_piece out[SURFACE_LEAF_MAX]) {
    const struct surface_node *node = &tree->nodes[index];
    if (!surface_is_leaf(tree, index)) {
        out[0] = tree->nodes[index + 1].piece;
        out[1] = tree->nodes[tree->nodes[index + 1].end].piece;
        return 2;
    }
    for (uint32_t i = 0; i < node->count; i++) {
        vec3 corners[3];
        corners_of(tree, node->first + i, corners);
        out[i] = surface_triangle(corners);
    }
    return (int)node->count;
}

// Without area, the middle of the pieces is as good a centre as any.
static struct surface_piece join(const struct surface_piece *pieces, int count) {
    struct surface_piece whole = {0};
    vec3 middle = {0};
    for (int i = 0; i < count; i++) {
        whole.area += pieces[i].area;
        whole.centre = vec3_add_scaled(whole.centre, pieces[i].area, pieces[i].centre);
        middle = vec3_add_scaled(middle, 1.0 / count, pieces[i].centre);
    }
    whole.centre = whole.area > 0 ? vec3_scale(1 / whole.area, whole.centre) : middle;
    for (int i = 0; i < count; i++) {
        vec3 off = vec3_sub(pieces[i].centre, whole.centre);
        whole.spread = mat3_add_scaled(whole.spread, 1, pieces[i].spread);
        surface_add_outer(&whole.spread, pieces[i].area, off, off);
    }
    return whole;
}

static double radius_of(const struct surface_tree *tree, const struct surface_node *node,
                        vec3 centre) {
    double largest = 0;
    for (uint32_t i = 0; i < node->count; i++) {
        vec3 corners[3];
        corners_of(tree, node->first + i, corners);
        for (int k = 0; k < 3; k++)
            largest = fmax(largest, vec3_distance(corners[k], centre));
    }
    return largest;
}

// ---- building -----------------------------------------------------------------------------------

struct builder {
    struct surface_tree *tree;
    vec3 *centres; // of each triangle
    uint32_t used; // nodes
};

static double along(vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

static int longest_axis(const struct builder *b, uint32_t first, uint32_t count) {
    vec3 low = b->centres[b->tree->order[first]], high = low;
    for (uint32_t i = first; i < first + count; i++) {
        vec3 c = b->centres[b->tree->order[i]];
        low = (vec3){fmin(low.x, c.x), fmin(low.y, c.y), fmin(low.z, c.z)};
        high = (vec3){fmax(high.x, c.x), fmax(high.y, c.y), fmax(high.z, c.z)};
    }
    vec3 size = vec3_sub(high, low);
    return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
}

// Quickselect: the lower `half` of the triangles, along the axis, come first.
static void split(const struct builder *b, uint32_t first, uint32_t count, uint32_t half) {
    int axis = longest_axis(b, first, count);
    uint32_t *order = b->tree->order;
    int64_t low = first, high = (int64_t)first + count - 1, middle = (int64_t)first + half;
    while (low < high) {
        double pivot = along(b->centres[order[(low + high) / 2]], axis);
        int64_t i = low, j = high;
        while (i <= j) {
            while (along(b->centres[order[i]], axis) < pivot)
                i++;
            while (along(b->centres[order[j]], axis) > pivot)
                j--;
            if (i > j)
                break;
            uint32_t kept = order[i];
            order[i++] = order[j];
            order[j--] = kept;
        }
        if (middle <= j)
            high = j;
        else if (middle >= i)
            low = i;
        else
            break;
    }
}

static void build(struct builder *b, uint32_t first, uint32_t count, uint32_t parent) {
    struct surface_tree *tree = b->tree;
    uint32_t index = b->used++, half = count / 2;
    struct surface_node *node = &tree->nodes[index];
    tree->parents[index] = parent;
    node->first = first;
    node->count = count;
    if (count > SURFACE_LEAF_MAX) {
        split(b, first, count, half);
        build(b, first, half, index);
        build(b, first + half, count - half, index);
    }
    node->end = b->used;
    struct surface_piece pieces[SURFACE_LEAF_MAX];
    node->piece = join(pieces, surface_pieces(tree, index, pieces));
    node->piece.radius = radius_of(tree, node, node->piece.centre);
}

static uint32_t nodes_for(uint32_t triangles) {
    uint32_t half = triangles / 2;
    return triangles <= SURFACE_LEAF_MAX ? 1 : 1 + nodes_for(half) + nodes_for(triangles - half);
}

// A counting sort of all corners by vertex.
static void list_leaves(struct surface_tree *tree) {
    const struct mesh *mesh = tree->mesh;
    size_t corners = 3 * (size_t)mesh->triangle_count;
    tree->leaf_of = alloc(corners, sizeof *tree->leaf_of);
    tree->first_of = alloc((size_t)mesh->vertex_count + 2, sizeof *tree->first_of);
    uint32_t *next = tree->first_of + 1; // becomes first_of when all are placed
    for (size_t i = 0; i < corners; i++)
        next[mesh->triangles[i] + 1]++;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        next[v + 1] += next[v];
    for (uint32_t n = 0; n < tree->node_count; n++)
        for (uint32_t i = 0; surface_is_leaf(tree, n) && i < 3 * tree->nodes[n].count; i++) {
            uint32_t triangle = tree->order[tree->nodes[n].first + i / 3];
            tree->leaf_of[next[mesh->triangles[3 * (size_t)triangle + i % 3]]++] = n;
        }
}

struct surface_tree *surface_tree_create(const struct mesh *mesh) {
    CHECK(mesh->triangle_count > 0);
    uint32_t count = mesh->triangle_count;
    struct surface_tree *tree = alloc(1, sizeof *tree);
    tree->mesh = mesh;
    tree->node_count = nodes_for(count);
    tree->nodes = alloc(tree->node_count, sizeof *tree->nodes);
    tree->parents = alloc(tree->node_count, sizeof *tree->parents);
    tree->order = alloc(count, sizeof *tree->order);
    struct builder b = {tree, alloc(count, sizeof *b.centres), 0};
    for (uint32_t t = 0; t < count; t++) {
        vec3 sum = vec3_add(mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1));
        b.centres[t] = vec3_add(sum, mesh_corner(mesh, t, 2));
        tree->order[t] = t;
    }
    build(&b, 0, count, 0);
    free(b.centres);
    list_leaves(tree);
    return tree;
}

void surface_tree_destroy(struct surface_tree **tree) {
    struct surface_tree *t = *tree;
    if (!t)
        return;
    free(t->nodes);
    free(t->parents);
    free(t->order);
    free(t->leaf_of);
    free(t->first_of);
    free(t);
    *tree = NULL;
}
