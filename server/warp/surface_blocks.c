#include "warp/surface_blocks.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

// ---- lanes --------------------------------------------------------------------------------------

static void set3(block_lanes out[3], int lane, vec3 v) {
    out[0][lane] = v.x;
    out[1][lane] = v.y;
    out[2][lane] = v.z;
}

static vec3 get3(const block_lanes in[3], int lane) {
    return (vec3){in[0][lane], in[1][lane], in[2][lane]};
}

static void set_piece(struct surface_block *block, int lane, const struct surface_piece *piece) {
    const double(*s)[3] = piece->spread.m;
    const double spread[6] = {s[0][0], s[0][1], s[0][2], s[1][1], s[1][2], s[2][2]};
    set3(block->centre, lane, piece->centre);
    block->area[lane] = piece->area;
    block->square[lane] = piece->radius * piece->radius;
    for (int i = 0; i < 6; i++)
        block->spread[i][lane] = spread[i];
}

static struct surface_piece piece_of(const struct surface_block *block, int lane) {
    double s[6];
    for (int i = 0; i < 6; i++)
        s[i] = block->spread[i][lane];
    return (struct surface_piece){
        .centre = get3(block->centre, lane),
        .area = block->area[lane],
        .spread = {{{s[0], s[1], s[2]}, {s[1], s[3], s[4]}, {s[2], s[4], s[5]}}}};
}

static void set_moments(struct block_moments *m, int lane, vec3 mean, const mat3 *slope) {
    set3(m->mean, lane, mean);
    for (int i = 0; i < 9; i++)
        m->slope[i][lane] = slope->m[i / 3][i % 3];
}

// ---- patches ------------------------------------------------------------------------------------

struct surface_patch surface_patch_of(const struct mesh *mesh, const float *displacement,
                                      uint32_t triangle) {
    const uint32_t *vertices = mesh->triangles + 3 * (size_t)triangle;
    struct surface_patch patch = {0};
    for (int i = 0; i < 3; i++) {
        patch.x[i] = mesh_vertex(mesh, vertices[i]);
        if (!displacement)
            continue;
        const float *u = displacement + 3 * (size_t)vertices[i];
        patch.u[i] = (vec3){(double)u[0], (double)u[1], (double)u[2]};
    }
    return patch;
}

// Over a triangle ∫ u sᵀ dA = A/12 Σ u sᵀ, summed over its corners.
void surface_patch_fill(const struct surface_patch *patch, int lane, struct surface_block *block,
                        struct block_moments *moments) {
    struct surface_piece piece = surface_triangle(patch->x);
    mat3 slope = {0};
    vec3 mean = vec3_add(vec3_add(patch->u[0], patch->u[1]), patch->u[2]);
    set_piece(block, lane, &piece);
    if (!moments)
        return;
    for (int i = 0; i < 3; i++) {
        moments->moves = moments->moves || vec3_dot(patch->u[i], patch->u[i]) > 0;
        surface_add_outer(&slope, piece.area / 12, patch->u[i],
                          vec3_sub(patch->x[i], piece.centre));
    }
    set_moments(moments, lane, vec3_scale(1.0 / 3, mean), &slope);
}

// ---- building -----------------------------------------------------------------------------------

struct builder {
    struct surface_blocks *out;
    uint32_t *order; // triangles
    vec3 *centres;   // of each triangle, times 3
};

static double along(vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

static int longest_axis(const struct builder *b, uint32_t first, uint32_t count) {
    vec3 low = b->centres[b->order[first]], high = low;
    for (uint32_t i = first; i < first + count; i++) {
        vec3 c = b->centres[b->order[i]];
        low = (vec3){fmin(low.x, c.x), fmin(low.y, c.y), fmin(low.z, c.z)};
        high = (vec3){fmax(high.x, c.x), fmax(high.y, c.y), fmax(high.z, c.z)};
    }
    vec3 size = vec3_sub(high, low);
    return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
}

// A total order: what is selected by it are the same triangles whichever way.
static bool before(const struct builder *b, int axis, uint32_t i, uint32_t k) {
    double x = along(b->centres[i], axis), y = along(b->centres[k], axis);
    return x < y || (x == y && i < k);
}

static uint32_t middle_of(const struct builder *b, int axis, uint32_t i, uint32_t k, uint32_t m) {
    if (before(b, axis, k, i)) {
        uint32_t swapped = i;
        i = k;
        k = swapped;
    }
    return before(b, axis, m, i) ? i : before(b, axis, k, m) ? k : m;
}

// Hoare's selection: the `count` triangles that come first are at the beginning, in any order.
static void select_first(const struct builder *b, int axis, uint32_t *order, uint32_t all,
                         uint32_t count) {
    uint32_t from = 0, to = all - 1;
    while (from < to) {
        uint32_t pivot = middle_of(b, axis, order[from], order[from + (to - from) / 2], order[to]);
        uint32_t i = from, k = to;
        for (;; i++, k--) {
            while (before(b, axis, order[i], pivot))
                i++;
            while (before(b, axis, pivot, order[k]))
                k--;
            if (i >= k)
                break;
            uint32_t swapped = order[i];
            order[i] = order[k];
            order[k] = swapped;
        }
        if (count <= k)
            to = k;
        else
            from = k + 1;
    }
}

// Into parts of `size` triangles that lie together, the last one of what is left.
static void divide(const struct builder *b, uint32_t first, uint32_t count, uint32_t size) {
    if (count <= size)
        return;
    uint32_t parts = (count + size - 1) / size, left = parts / 2 * size;
    select_first(b, longest_axis(b, first, count), b->order + first, count, left);
    divide(b, first, left, size);
    divide(b, first + left, count - left, size);
}

static struct surface_piece join(const struct surface_block *block, uint32_t count) {
    struct surface_piece whole = {0};
    vec3 middle = {0};
    for (uint32_t i = 0; i < count; i++) {
        vec3 centre = get3(block->centre, (int)i);
        whole.area += block->area[i];
        whole.centre = vec3_add_scaled(whole.centre, block->area[i], centre);
        middle = vec3_add_scaled(middle, 1.0 / count, centre);
    }
    whole.centre = whole.area > 0 ? vec3_scale(1 / whole.area, whole.centre) : middle;
    for (uint32_t i = 0; i < count; i++) {
        struct surface_piece piece = piece_of(block, (int)i);
        vec3 off = vec3_sub(piece.centre, whole.centre);
        whole.spread = mat3_add_scaled(whole.spread, 1, piece.spread);
        surface_add_outer(&whole.spread, piece.area, off, off);
    }
    return whole;
}

static double radius_of(const struct builder *b, uint32_t first, uint32_t count, vec3 centre) {
    double largest = 0;
    for (uint32_t i = 3 * first; i < 3 * (first + count); i++) {
        vec3 corner = mesh_corner(b->out->mesh, b->order[i / 3], (int)(i % 3));
        largest = fmax(largest, vec3_distance(corner, centre));
    }
    return largest;
}

static uint32_t build(struct builder *b, uint32_t first, uint32_t count, uint32_t parent) {
    uint32_t index = b->out->count++, size = 1;
    struct surface_block *block = &b->out->blocks[index];
    while (size * BLOCK_LANES < count)
        size *= BLOCK_LANES;
    block->parent = parent;
    block->is_bottom = size == 1;
    divide(b, first, count, size);
    for (uint32_t i = 0; i * size < count; i++) {
        uint32_t from = first + i * size, some = i * size + size < count ? size : count - i * size;
        if (block->is_bottom) {
            struct surface_patch patch = surface_patch_of(b->out->mesh, NULL, b->order[from]);
            block->child[i] = b->order[from];
            surface_patch_fill(&patch, (int)i, block, NULL);
        } else {
            block->child[i] = build(b, from, some, index);
            const struct surface_block *below = &b->out->blocks[block->child[i]];
            struct surface_piece piece = join(below, below->count);
            piece.radius = radius_of(b, from, some, piece.centre);
            set_piece(block, (int)i, &piece);
        }
        block->count = i + 1;
    }
    return index;
}

static uint32_t blocks_for(uint32_t triangles) {
    uint32_t sum = 1;
    for (uint64_t size = BLOCK_LANES; size < triangles; size *= BLOCK_LANES)
        sum += (uint32_t)((triangles + size - 1) / size);
    return sum;
}

// A counting sort of all corners by vertex.
static void list_bottoms(struct surface_blocks *out) {
    const struct mesh *mesh = out->mesh;
    size_t corners = 3 * (size_t)mesh->triangle_count;
    out->bottom_of = alloc(corners, sizeof *out->bottom_of);
    out->first_of = alloc((size_t)mesh->vertex_count + 2, sizeof *out->first_of);
    uint32_t *next = out->first_of + 1; // becomes first_of when all are placed
    for (size_t i = 0; i < corners; i++)
        next[mesh->triangles[i] + 1]++;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        next[v + 1] += next[v];
    for (uint32_t n = 0; n < out->count; n++)
        for (uint32_t i = 0; out->blocks[n].is_bottom && i < 3 * out->blocks[n].count; i++) {
            size_t corner = 3 * (size_t)out->blocks[n].child[i / 3] + i % 3;
            out->bottom_of[next[mesh->triangles[corner]]++] = n;
        }
}

static void *alloc_lanes(size_t count, size_t size) {
    return memset(alloc_aligned(BLOCK_ALIGN, count * size), 0, count * size);
}

struct surface_blocks *surface_blocks_create(const struct mesh *mesh) {
    CHECK(mesh->triangle_count > 0);
    uint32_t count = mesh->triangle_count, most = blocks_for(count);
    struct surface_blocks *out = alloc(1, sizeof *out);
    out->mesh = mesh;
    out->blocks = alloc_lanes(most, sizeof *out->blocks);
    struct builder b = {out, alloc(count, sizeof *b.order), alloc(count, sizeof *b.centres)};
    for (uint32_t t = 0; t < count; t++) {
        vec3 sum = vec3_add(mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1));
        b.centres[t] = vec3_add(sum, mesh_corner(mesh, t, 2));
        b.order[t] = t;
    }
    build(&b, 0, count, 0);
    CHECK(out->count <= most);
    free(b.order);
    free(b.centres);
    list_bottoms(out);
    return out;
}

void surface_blocks_destroy(struct surface_blocks **blocks) {
    struct surface_blocks *b = *blocks;
    if (!b)
        return;
    free(b->blocks);
    free(b->bottom_of);
    free(b->first_of);
    free(b);
    *blocks = NULL;
}

// ---- moments ------------------------------------------------------------------------------------

// Lane `lane` of an inner block: what is in the block below.
static void gather_lane(const struct surface_blocks *blocks, struct block_moments *all,
                        uint32_t index, int lane) {
    const struct surface_block *block = &blocks->blocks[index];
    const struct surface_block *below = &blocks->blocks[block->child[lane]];
    const struct block_moments *part = &all[block->child[lane]];
    double whole = block->area[lane];
    vec3 centre = get3(block->centre, lane), mean = {0};
    mat3 slope = {0};
    for (int i = 0; i < (int)below->count; i++) {
        vec3 u = get3(part->mean, i), off = vec3_sub(get3(below->centre, i), centre);
        mean = vec3_add_scaled(mean, whole > 0 ? below->area[i] / whole : 0, u);
        for (int k = 0; k < 9; k++)
            slope.m[k / 3][k % 3] += part->slope[k][i];
        surface_add_outer(&slope, below->area[i], u, off);
    }
    set_moments(&all[index], lane, mean, &slope);
    all[index].moves = all[index].moves || part->moves;
}

void surface_block_gather(const struct surface_blocks *blocks, const float *displacement,
                          struct block_moments *all, uint32_t index) {
    struct surface_block ignored;
    const struct surface_block *block = &blocks->blocks[index];
    all[index].moves = false;
    for (int i = 0; i < (int)block->count; i++) {
        if (!block->is_bottom) {
            gather_lane(blocks, all, index, i);
            continue;
        }
        struct surface_patch patch = surface_patch_of(blocks->mesh, displacement, block->child[i]);
        surface_patch_fill(&patch, i, &ignored, &all[index]);
    }
}
