#include "warp/surface_integral.h"

#include "base/check.h"
#include "warp/surface_walk.h"

#include <stdlib.h>
#include <string.h>

#define SQUARE_MAX 1e24 // beyond, what is summed underflows

struct surface_integral {
    const struct surface_blocks *blocks;
    const float *displacement;
    struct block_moments *moments; // of each block; NULL without displacement
    bool *is_stale;                // with all above it
};

// ---- moments ------------------------------------------------------------------------------------

static void refresh(struct surface_integral *integral, uint32_t index) {
    const struct surface_block *block = &integral->blocks->blocks[index];
    if (!integral->is_stale[index])
        return;
    integral->is_stale[index] = false;
    for (uint32_t i = 0; !block->is_bottom && i < block->count; i++)
        refresh(integral, block->child[i]);
    surface_block_gather(integral->blocks, integral->displacement, integral->moments, index);
}

struct surface_integral *surface_integral_create(const struct surface_blocks *blocks,
                                                 const float *displacement) {
    struct surface_integral *integral = alloc(1, sizeof *integral);
    integral->blocks = blocks;
    integral->displacement = displacement;
    if (!displacement)
        return integral;
    size_t size = blocks->count * sizeof *integral->moments;
    integral->moments = alloc_aligned(BLOCK_ALIGN, size);
    memset(integral->moments, 0, size);
    integral->is_stale = alloc(blocks->count, sizeof *integral->is_stale);
    for (uint32_t i = 0; i < blocks->count; i++)
        integral->is_stale[i] = true;
    refresh(integral, 0);
    return integral;
}

void surface_integral_destroy(struct surface_integral **integral) {
    if (!*integral)
        return;
    free((*integral)->moments);
    free((*integral)->is_stale);
    free(*integral);
    *integral = NULL;
}

void surface_integral_update(struct surface_integral *integral, const uint32_t *vertices,
                             uint32_t count) {
    const struct surface_blocks *blocks = integral->blocks;
    CHECK(integral->moments);
    for (uint32_t i = 0; i < count; i++) {
        CHECK(vertices[i] < blocks->mesh->vertex_count);
        for (uint32_t k = blocks->first_of[vertices[i]]; k < blocks->first_of[vertices[i] + 1]; k++)
            for (uint32_t n = blocks->bottom_of[k]; !integral->is_stale[n];
                 n = blocks->blocks[n].parent)
                integral->is_stale[n] = true;
    }
    refresh(integral, 0);
}

// ---- asking -------------------------------------------------------------------------------------

// In a fixed order.
static double total(const block_lanes a) {
    return ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7]));
}

static vec3 total3(const block_lanes sums[3]) {
    return (vec3){total(sums[0]), total(sums[1]), total(sums[2])};
}

static mat3 total9(const block_lanes sums[9]) {
    mat3 out;
    for (int i = 0; i < 9; i++)
        out.m[i / 3][i % 3] = total(sums[i]);
    return out;
}

// A mean is one integral over another: ∇(a/w) = (∇a − (a/w) ∇wᵀ)/w.
static mat3 mean_slope(mat3 slope, vec3 mean, vec3 weight_slope, double scale) {
    mat3 zero = {0};
    surface_add_outer(&slope, -1, mean, weight_slope);
    return mat3_add_scaled(zero, scale, slope);
}

bool surface_integral_at(const struct surface_integral *integral, vec3 p, vec3 closest,
                         struct surface_sight *out) {
    vec3 off = vec3_sub(p, closest);
    struct walk walk = {.blocks = integral->blocks,
                        .displacement = integral->displacement,
                        .moments = integral->moments,
                        .p = p,
                        .off = off,
                        .square = vec3_dot(off, off)};
    const double least = SURFACE_INTEGRAL_NEAREST_MM * SURFACE_INTEGRAL_NEAREST_MM;
    if (!(walk.square > 0.99 * least && walk.square < SQUARE_MAX))
        return false;
    surface_walk(&walk, surface_walk_best());
    double weight = total(walk.sums.weight), scale = 1 / weight;
    if (!(weight > 0))
        return false;
    vec3 weight_slope = total3(walk.sums.weight_slope);
    vec3 place = vec3_scale(scale, total3(walk.sums.place));
    *out = (struct surface_sight){weight, weight_slope};
    out->point = vec3_add(p, place);
    out->slide = mean_slope(total9(walk.sums.place_slope), place, weight_slope, scale);
    out->slide = mat3_add_scaled(mat3_identity(), 1, out->slide);
    if (!integral->moments)
        return true;
    out->displacement = vec3_scale(scale, total3(walk.sums.field));
    out->change = mean_slope(total9(walk.sums.field_slope), out->displacement, weight_slope, scale);
    return true;
}
