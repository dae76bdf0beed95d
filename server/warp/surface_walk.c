#include "warp/surface_walk.h"

#include "warp/lanes.h"

#include <string.h>

// A piece of surface is taken as a whole where it is smaller than FAR_SIZE of its distance,
// squared, and what its moments leave out is less than FAR_ERROR of the whole integral; a quarter
// and a half before that both begin to be blended with its parts.
#define FAR_SIZE 0.5
#define FAR_ERROR 0.02

// From the plane of a triangle, over the closest distance, squared: under the first its closed
// integral is left to its parts, over the second it is good.
#define LEVEL_LOW 1.6e-5
#define LEVEL_HIGH 6.4e-5

#define SQUARE_MIN 1e-20 // of a distance from a centre
#define STACK_MAX 128

// How much of each lane's piece counts, and how that changes with p.
struct shares {
    lanes8 share, slope[3];
};

struct opening {
    struct shares whole, parts; // what is taken by its moments, and what is left to its parts
    lanes8 r[3], inverse;       // from the centre to p; 1/r²
    bool is_sloped, has_whole, has_parts;
};

// ---- far pieces ---------------------------------------------------------------------------------

// With t = r²: z = (radius²/t)³ (A d²/t²)² / FAR_ERROR², y = radius²/(FAR_SIZE t), and their ramps.
LANES_INLINE void open_block(const struct walk *walk, const struct surface_block *block,
                             const struct shares *above, struct opening *out) {
    const double p[3] = {walk->p.x, walk->p.y, walk->p.z};
    const double off[3] = {walk->off.x, walk->off.y, walk->off.z};
    for (int i = 0; i < 3; i++)
        out->r[i] = p[i] - block->centre[i];
    lanes8 t = dot8(out->r, out->r), by_z, by_y;
    t = choose8(t > SQUARE_MIN, t, spread8(SQUARE_MIN));
    lanes8 inverse = 1 / t, a = block->square * inverse;
    lanes8 c = block->area * inverse * (walk->square * inverse);
    mask8 real = block->area > 0.0;
    lanes8 z = choose8(real, a * a * a * (c * c) * (1 / (FAR_ERROR * FAR_ERROR)), spread8(0));
    lanes8 y = choose8(real, a * (1 / FAR_SIZE), spread8(0));
    lanes8 far_z = ramp8((1 - z) * (1 / 0.75), &by_z), far_y = ramp8((1 - y) * 4, &by_y);
    lanes8 far = far_z * far_y;
    by_z = choose8(by_z > 0.0, by_z * (-1 / 0.75) * z * far_y, spread8(0));
    by_y = choose8(by_y > 0.0, by_y * -4.0 * y * far_z, spread8(0));
    lanes8 along_r = (-14 * by_z - 2 * by_y) * inverse, along_off = by_z * (4 / walk->square);
    out->inverse = inverse;
    out->has_whole = any8(far > 0.0);
    out->has_parts = any8(far < 1.0);
    out->is_sloped = any8((above->share < 1.0) | ((far > 0.0) & (far < 1.0)));
    out->whole.share = above->share * far;
    out->parts.share = above->share * (1 - far);
    for (int i = 0; i < 3; i++) {
        lanes8 slope = above->share * (along_r * out->r[i] + along_off * off[i]);
        out->whole.slope[i] = above->slope[i] * far + slope;
        out->parts.slope[i] = above->slope[i] * (1 - far) - slope;
    }
}

// Adds an integral of which `shares` count; `value` and `slope` hold the shares already where these
// do not change with p.
LANES_INLINE void add3(lanes8 sum[3], lanes8 sum_slope[9], const lanes8 value[3],
                       const lanes8 slope[9], const struct shares *shares, bool is_sloped) {
    for (int i = 0; i < 3; i++) {
        sum[i] += is_sloped ? shares->share * value[i] : value[i];
        for (int k = 0; k < 3; k++)
            sum_slope[3 * i + k] +=
                is_sloped ? shares->share * slope[3 * i + k] + value[i] * shares->slope[k]
                          : slope[3 * i + k];
    }
}

LANES_INLINE void add1(struct lane_sums *sums, lanes8 value, const lanes8 slope[3],
                       const struct shares *shares, bool is_sloped) {
    sums->weight += is_sloped ? shares->share * value : value;
    for (int k = 0; k < 3; k++)
        sums->weight_slope[k] +=
            is_sloped ? shares->share * slope[k] + value * shares->slope[k] : slope[k];
}

// |r − s|⁻⁴ to second order in s. With f = r⁻⁴, g = 4 f/r², h = 6 g/r², k = 8 h/r², of which each
// is minus the gradient of the one before over r:
//     w = ∫ |r − s|⁻⁴ dA = A f + ½ (h rᵀSr − g tr S),   S = ∫ s sᵀ dA
//     ∫ u … dA = ū w + g K r,  K = ∫ u sᵀ dA;   ∫ (x − p) … dA = −r w + g S r
LANES_INLINE void add_far(struct lane_sums *sums, const struct surface_block *block,
                          const struct block_moments *m, const struct opening *open,
                          bool is_sloped) {
    static const int at[9] = {0, 1, 2, 1, 3, 4, 2, 4, 5};
    const lanes8 *r = open->r, *S = block->spread;
    lanes8 inverse = open->inverse, f = inverse * inverse;
    if (!is_sloped)
        f = f * open->whole.share;
    lanes8 g = 4 * inverse * f, h = 6 * inverse * g, k = 8 * inverse * h;
    lanes8 Sr[3], slope[3], value[3], value_slope[9];
    for (int i = 0; i < 3; i++)
        Sr[i] = S[at[3 * i]] * r[0] + S[at[3 * i + 1]] * r[1] + S[at[3 * i + 2]] * r[2];
    lanes8 rSr = dot8(r, Sr), trace = S[0] + S[3] + S[5];
    lanes8 w = block->area * f + 0.5 * (h * rSr - g * trace);
    lanes8 along = 0.5 * (h * trace - k * rSr) - g * block->area;
    for (int i = 0; i < 3; i++)
        slope[i] = along * r[i] + h * Sr[i];
    add1(sums, w, slope, &open->whole, is_sloped);
    for (int i = 0; i < 3; i++) {
        value[i] = g * Sr[i] - w * r[i];
        for (int j = 0; j < 3; j++)
            value_slope[3 * i + j] = g * S[at[3 * i + j]] - h * Sr[i] * r[j] - r[i] * slope[j];
        value_slope[4 * i] -= w;
    }
    add3(sums->place, sums->place_slope, value, value_slope, &open->whole, is_sloped);
    if (!m || !m->moves)
        return;
    for (int i = 0; i < 3; i++) {
        const lanes8 *K = m->slope + 3 * i;
        lanes8 Kr = dot8(K, r);
        value[i] = m->mean[i] * w + g * Kr;
        for (int j = 0; j < 3; j++)
            value_slope[3 * i + j] = m->mean[i] * slope[j] - h * Kr * r[j] + g * K[j];
    }
    add3(sums->field, sums->field_slope, value, value_slope, &open->whole, is_sloped);
}

LANES_INLINE void take_whole(struct walk *walk, const struct surface_block *block,
                             const struct block_moments *m, const struct opening *open) {
    if (open->has_whole && open->is_sloped)
        add_far(&walk->sums, block, m, open, true);
    else if (open->has_whole)
        add_far(&walk->sums, block, m, open, false);
}

LANES_INLINE struct shares one_share(const struct shares *of, int lane) {
    return (struct shares){
        spread8(of->share[lane]),
        {spread8(of->slope[0][lane]), spread8(of->slope[1][lane]), spread8(of->slope[2][lane])}};
}

// ---- triangles in whose plane p nearly lies -----------------------------------------------------

static int longest_side(const struct surface_patch *patch) {
    double squares[3];
    for (int i = 0; i < 3; i++) {
        vec3 side = vec3_sub(patch->x[(i + 1) % 3], patch->x[i]);
        squares[i] = vec3_dot(side, side);
    }
    int longest = squares[1] > squares[0];
    return squares[2] > squares[longest] ? 2 : longest;
}

static void halve(const struct surface_patch *patch, struct surface_patch out[2]) {
    int from = longest_side(patch), to = (from + 1) % 3;
    out[0] = out[1] = *patch;
    out[0].x[to] = out[1].x[from] = vec3_lerp(patch->x[from], patch->x[to], 0.5);
    out[0].u[to] = out[1].u[from] = vec3_lerp(patch->u[from], patch->u[to], 0.5);
}

// In eight, until all parts are far.
static void walk_parts(struct walk *walk, const struct surface_patch *patch,
                       const struct shares *above) {
    struct surface_patch parts[BLOCK_LANES] = {*patch}, halves[BLOCK_LANES];
    struct surface_block block = {0};
    struct block_moments moments = {0};
    struct opening open;
    for (int count = 1; count < BLOCK_LANES; count *= 2) {
        for (int i = 0; i < count; i++)
            halve(&parts[i], halves + 2 * i);
        memcpy(parts, halves, sizeof parts);
    }
    for (int i = 0; i < BLOCK_LANES; i++)
        surface_patch_fill(&parts[i], i, &block, &moments);
    open_block(walk, &block, above, &open);
    take_whole(walk, &block, &moments, &open);
    for (int i = 0; i < BLOCK_LANES; i++)
        if (open.parts.share[i] > 0) {
            struct shares shares = one_share(&open.parts, i);
            walk_parts(walk, &parts[i], &shares);
        }
}

// ---- near triangles -----------------------------------------------------------------------------

// Eight triangles as p sees them.
struct triangles8 {
    lanes8 corner[3][3], moved[3][3]; // from p; displacements
    lanes8 normal[3], height;         // unit; of p above the plane
    lanes8 dual[2][3];                // of the sides from corner 0, in the plane
};

LANES_INLINE void sides_of(struct triangles8 *t) {
    lanes8 a[3], b[3], m[3];
    for (int i = 0; i < 3; i++) {
        a[i] = t->corner[1][i] - t->corner[0][i];
        b[i] = t->corner[2][i] - t->corner[0][i];
    }
    cross8(a, b, m);
    lanes8 scale = 1 / dot8(m, m), unit = root8(scale);
    cross8(b, m, t->dual[0]);
    cross8(m, a, t->dual[1]);
    for (int i = 0; i < 3; i++) {
        t->normal[i] = m[i] * unit;
        t->dual[0][i] *= scale;
        t->dual[1][i] *= scale;
    }
    t->height = -dot8(t->normal, t->corner[0]);
}

// Lanes that do not count get a triangle that does no harm.
LANES_INLINE void load_triangles(const struct walk *walk, const struct surface_block *block,
                                 const struct shares *shares, struct triangles8 *out) {
    const struct mesh *mesh = walk->blocks->mesh;
    const double p[3] = {walk->p.x, walk->p.y, walk->p.z};
    memset(out->moved, 0, sizeof out->moved);
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 3; i++)
            out->corner[c][i] = spread8(c != i);
    for (int lane = 0; lane < BLOCK_LANES; lane++) {
        if (!(shares->share[lane] > 0))
            continue;
        const uint32_t *v = mesh->triangles + 3 * (size_t)block->child[lane];
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < 3; i++) {
                size_t at = 3 * (size_t)v[c] + (size_t)i;
                out->corner[c][i][lane] = (double)mesh->positions[at] - p[i];
                if (walk->displacement)
                    out->moved[c][i][lane] = (double)walk->displacement[at];
            }
    }
    sides_of(out);
}

// The integrals of r⁻⁴ and of ρ r⁻⁴ over triangles, ρ in the plane from the foot of p, and their
// derivatives by p.
struct closed8 {
    lanes8 one, one_slope[3];
    lanes8 plane[3], plane_slope[9];
};

// By Gauss's theorem, with q a side's distance from the foot, s along it, p² = q² + h²:
//     T = ∫ ds/r²,  V = ∫ ds/r⁴,  ∫ r⁻⁴ dA = Σ q T/(2h²),  ∫ ρ r⁻⁴ dA = −½ Σ ν T
LANES_INLINE void add_side(const struct triangles8 *t, int from, lanes8 *sum_qT, lanes8 *sum_qV,
                           struct closed8 *out) {
    const lanes8 *a = t->corner[from], *b = t->corner[(from + 1) % 3], *n = t->normal;
    lanes8 along[3], across[3], h = t->height;
    for (int i = 0; i < 3; i++)
        along[i] = b[i] - a[i];
    lanes8 length = root8(dot8(along, along));
    for (int i = 0; i < 3; i++)
        along[i] = along[i] / length;
    cross8(along, n, across);
    lanes8 q = dot8(a, across), s0 = dot8(a, along), s1 = s0 + length;
    lanes8 square = q * q + h * h, p = root8(square);
    lanes8 near = 1 / (s0 * s0 + square), far = 1 / (s1 * s1 + square), ends = far - near;
    lanes8 T = angle8(square + s0 * s1, p * length) / p;
    lanes8 V = 0.5 * (s1 * far - s0 * near + T) / square;
    *sum_qT += q * T;
    *sum_qV += q * V;
    for (int i = 0; i < 3; i++) {
        out->one_slope[i] -= across[i] * V;
        out->plane[i] -= 0.5 * across[i] * T;
        for (int k = 0; k < 3; k++) {
            lanes8 slope = 2 * V * (q * across[k] - h * n[k]) - ends * along[k];
            out->plane_slope[3 * i + k] -= 0.5 * across[i] * slope;
        }
    }
}

LANES_INLINE void integrate(const struct triangles8 *t, struct closed8 *out) {
    lanes8 qT = spread8(0), qV = spread8(0), h = t->height;
    memset(out, 0, sizeof *out);
    for (int side = 0; side < 3; side++)
        add_side(t, side, &qT, &qV, out);
    out->one = 0.5 * qT / (h * h);
    for (int i = 0; i < 3; i++)
        out->one_slope[i] -= t->normal[i] * (2 * out->one + qV) / h;
}

// u = u0 + Σ Δu_j b_j, b_j linear over the triangle: ∫ b_j r⁻⁴ = dual_j · (∫ ρ r⁻⁴ − ρ0 ∫ r⁻⁴).
LANES_INLINE void add_moved(struct lane_sums *sums, const struct triangles8 *t,
                            const struct closed8 *c, const struct shares *shares) {
    lanes8 value[3], slope[9], by[3];
    for (int i = 0; i < 3; i++) {
        value[i] = t->moved[0][i] * c->one;
        for (int k = 0; k < 3; k++)
            slope[3 * i + k] = t->moved[0][i] * c->one_slope[k];
    }
    for (int j = 0; j < 2; j++) {
        const lanes8 *dual = t->dual[j];
        lanes8 start = dot8(dual, t->corner[0]), b = dot8(dual, c->plane) - start * c->one;
        for (int k = 0; k < 3; k++)
            by[k] = dual[0] * c->plane_slope[k] + dual[1] * c->plane_slope[3 + k] +
                    dual[2] * c->plane_slope[6 + k] - start * c->one_slope[k] + dual[k] * c->one;
        for (int i = 0; i < 3; i++) {
            lanes8 rise = t->moved[j + 1][i] - t->moved[0][i];
            value[i] += rise * b;
            for (int k = 0; k < 3; k++)
                slope[3 * i + k] += rise * by[k];
        }
    }
    add3(sums->field, sums->field_slope, value, slope, shares, true);
}

LANES_INLINE void add_closed(struct walk *walk, const struct triangles8 *t,
                             const struct shares *shares, bool moves) {
    struct closed8 c;
    lanes8 value[3], slope[9], h = t->height;
    integrate(t, &c);
    add1(&walk->sums, c.one, c.one_slope, shares, true);
    for (int i = 0; i < 3; i++) {
        value[i] = c.plane[i] - h * t->normal[i] * c.one;
        for (int k = 0; k < 3; k++)
            slope[3 * i + k] = c.plane_slope[3 * i + k] -
                               t->normal[i] * (t->normal[k] * c.one + h * c.one_slope[k]);
    }
    add3(walk->sums.place, walk->sums.place_slope, value, slope, shares, true);
    if (moves)
        add_moved(&walk->sums, t, &c, shares);
}

// How much of each triangle its closed integral may stand for; the rest into *out_rest.
LANES_INLINE bool split_level(const struct walk *walk, struct triangles8 *t, struct shares *shares,
                              struct shares *out_rest) {
    const double off[3] = {walk->off.x, walk->off.y, walk->off.z};
    lanes8 h = t->height, level = h * h * (1 / walk->square), by;
    if (!any8((level < LEVEL_HIGH) & (shares->share > 0.0)))
        return false;
    lanes8 good = ramp8((level - LEVEL_LOW) * (1 / (LEVEL_HIGH - LEVEL_LOW)), &by);
    by = by * (1 / (LEVEL_HIGH - LEVEL_LOW)) * (2 / walk->square);
    struct shares all = *shares;
    shares->share = all.share * good;
    out_rest->share = all.share * (1 - good);
    for (int i = 0; i < 3; i++) {
        lanes8 slope = all.share * by * (h * t->normal[i] - level * off[i]);
        shares->slope[i] = all.slope[i] * good + slope;
        out_rest->slope[i] = all.slope[i] * (1 - good) - slope;
    }
    t->height = choose8(good > 0.0, h, spread8(1)); // what does not count must be finite
    return true;
}

LANES_INLINE void walk_triangles(struct walk *walk, const struct surface_block *block,
                                 struct shares *shares, bool moves) {
    struct triangles8 t;
    struct shares rest;
    load_triangles(walk, block, shares, &t);
    bool is_split = split_level(walk, &t, shares, &rest);
    add_closed(walk, &t, shares, moves);
    for (int i = 0; is_split && i < (int)block->count; i++)
        if (rest.share[i] > 0) {
            struct surface_patch patch =
                surface_patch_of(walk->blocks->mesh, walk->displacement, block->child[i]);
            struct shares one = one_share(&rest, i);
            walk_parts(walk, &patch, &one);
        }
}

// ---- the walk -----------------------------------------------------------------------------------

struct step {
    uint32_t block;
    double share, slope[3];
};

LANES_INLINE void walk_all(struct walk *walk) {
    struct step stack[STACK_MAX] = {{0, 1, {0, 0, 0}}};
    int depth = 1;
    while (depth > 0) {
        struct step step = stack[--depth];
        const struct surface_block *block = &walk->blocks->blocks[step.block];
        const struct block_moments *m = walk->moments ? &walk->moments[step.block] : NULL;
        struct shares above = {
            spread8(step.share),
            {spread8(step.slope[0]), spread8(step.slope[1]), spread8(step.slope[2])}};
        struct opening open;
        open_block(walk, block, &above, &open);
        take_whole(walk, block, m, &open);
        if (open.has_parts && block->is_bottom)
            walk_triangles(walk, block, &open.parts, m && m->moves);
        for (int i = 0; open.has_parts && !block->is_bottom && i < (int)block->count; i++) {
            const struct shares *parts = &open.parts;
            if (parts->share[i] > 0)
                stack[depth++] =
                    (struct step){block->child[i],
                                  parts->share[i],
                                  {parts->slope[0][i], parts->slope[1][i], parts->slope[2][i]}};
        }
    }
}

static void walk_plain(struct walk *walk) {
    walk_all(walk);
}

#if defined(__x86_64__)

__attribute__((target("avx512f,avx512dq"))) static void walk_avx512(struct walk *walk) {
    walk_all(walk);
}

__attribute__((target("avx2"))) static void walk_avx2(struct walk *walk) {
    walk_all(walk);
}

enum walk_level surface_walk_best(void) {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
        return WALK_AVX512;
    return __builtin_cpu_supports("avx2") ? WALK_AVX2 : WALK_PLAIN;
}

void surface_walk(struct walk *walk, enum walk_level level) {
    static void (*const walks[WALK_LEVELS])(struct walk *) = {
        [WALK_PLAIN] = walk_plain, [WALK_AVX2] = walk_avx2, [WALK_AVX512] = walk_avx512};
    walks[level](walk);
}

#else

enum walk_level surface_walk_best(void) {
    return WALK_PLAIN;
}

void surface_walk(struct walk *walk, enum walk_level level) {
    (void)level;
    walk_plain(walk);
}

#endif
