// The walk of warp/surface_walk.h, for the levels' own files: each says how WIDE its registers are,
// and by WIDE_TARGET what the processor must have.
#pragma once

#include "warp/lanes.h"
#include "warp/surface_walk.h"

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
#define BLOCK_CHUNKS (BLOCK_LANES / WIDE)

// How much of a piece counts, and how that changes with p.
struct share {
    double value, slope[3];
};

struct wide_shares {
    wide value, slope[3];
};

struct block_shares {
    block_lanes value, slope[3];
};

LANES_INLINE struct share lane_share(const struct block_shares *of, int lane) {
    return (struct share){of->value[lane],
                          {of->slope[0][lane], of->slope[1][lane], of->slope[2][lane]}};
}

LANES_INLINE struct wide_shares load_shares(const struct block_shares *of, int at) {
    return (struct wide_shares){
        wide_load(of->value + at),
        {wide_load(of->slope[0] + at), wide_load(of->slope[1] + at), wide_load(of->slope[2] + at)}};
}

LANES_INLINE void store_shares(struct block_shares *to, int at, const struct wide_shares *shares) {
    wide_store(to->value + at, shares->value);
    for (int i = 0; i < 3; i++)
        wide_store(to->slope[i] + at, shares->slope[i]);
}

// ---- far pieces ---------------------------------------------------------------------------------

// The pieces of one block.
struct opening {
    const struct surface_block *block;
    const struct block_moments *moments; // NULL for 0
    struct share above;
    bool has_parts;                   // else all are taken as a whole, with the share above
    struct block_shares whole, parts; // what is taken by its moments, and what is left to its parts
    block_lanes r[3], inverse;        // from the centre to p; 1/r²
};

// z and y from which pieces begin to be blended with their parts.
#define FAR_ERROR_SHARE 0.25
#define FAR_SIZE_SHARE 0.75

LANES_INLINE struct wide_shares spread_share(const struct share *of) {
    return (struct wide_shares){
        wide_of(of->value), {wide_of(of->slope[0]), wide_of(of->slope[1]), wide_of(of->slope[2])}};
}

LANES_INLINE void blend_opening(const struct walk *walk, int at, wide z, wide y,
                                struct opening *out) {
    const double off[3] = {walk->off.x, walk->off.y, walk->off.z};
    const struct share *above = &out->above;
    struct wide_shares whole, parts;
    wide by_z, by_y, far_z = wide_ramp((1 - z) * (1 / (1 - FAR_ERROR_SHARE)), &by_z);
    wide far_y = wide_ramp((1 - y) * (1 / (1 - FAR_SIZE_SHARE)), &by_y), far = far_z * far_y;
    by_z = wide_choose(by_z > 0.0, by_z * (-1 / (1 - FAR_ERROR_SHARE)) * z * far_y, wide_of(0));
    by_y = wide_choose(by_y > 0.0, by_y * (-1 / (1 - FAR_SIZE_SHARE)) * y * far_z, wide_of(0));
    wide along_r = (-14 * by_z - 2 * by_y) * wide_load(out->inverse + at);
    wide along_off = by_z * (4 / walk->square);
    whole.value = above->value * far;
    parts.value = above->value * (1 - far);
    for (int i = 0; i < 3; i++) {
        wide slope = above->value * (along_r * wide_load(out->r[i] + at) + along_off * off[i]);
        whole.slope[i] = above->slope[i] * far + slope;
        parts.slope[i] = above->slope[i] * (1 - far) - slope;
    }
    store_shares(&out->whole, at, &whole);
    store_shares(&out->parts, at, &parts);
}

// With t = r²: z = (radius²/t)³ (A d²/t²)² / FAR_ERROR², y = radius²/(FAR_SIZE t), and their ramps.
LANES_INLINE void open_block(const struct walk *walk, const struct surface_block *block,
                             const struct block_moments *moments, const struct share *above,
                             struct opening *out) {
    const double p[3] = {walk->p.x, walk->p.y, walk->p.z};
    wide z[BLOCK_CHUNKS], y[BLOCK_CHUNKS];
    wide_mask near = {0};
    out->block = block;
    out->moments = moments;
    out->above = *above;
    for (int i = 0; i < BLOCK_CHUNKS; i++) {
        int at = i * WIDE;
        wide r[3];
        for (int k = 0; k < 3; k++) {
            r[k] = p[k] - wide_load(block->centre[k] + at);
            wide_store(out->r[k] + at, r[k]);
        }
        wide area = wide_load(block->area + at), t = wide_dot(r, r);
        t = wide_choose(t > SQUARE_MIN, t, wide_of(SQUARE_MIN));
        wide inverse = 1 / t, a = wide_load(block->square + at) * inverse;
        wide c = area * inverse * (walk->square * inverse);
        wide_mask real = area > 0.0;
        wide_store(out->inverse + at, inverse);
        z[i] = wide_choose(real, a * a * a * (c * c) * (1 / (FAR_ERROR * FAR_ERROR)), wide_of(0));
        y[i] = wide_choose(real, a * (1 / FAR_SIZE), wide_of(0));
        near |= (z[i] > FAR_ERROR_SHARE) | (y[i] > FAR_SIZE_SHARE);
    }
    out->has_parts = wide_any(near);
    for (int i = 0; out->has_parts && i < BLOCK_CHUNKS; i++)
        blend_opening(walk, i * WIDE, z[i], y[i], out);
}

// |r − s|⁻⁴ to second order in s. With f = r⁻⁴, g = 4 f/r², h = 6 g/r², k = 8 h/r², of which each
// is minus the gradient of the one before over r:
//     w = ∫ |r − s|⁻⁴ dA = A f + ½ (h rᵀSr − g tr S),   S = ∫ s sᵀ dA
//     ∫ u … dA = ū w + g K r,  K = ∫ u sᵀ dA;   ∫ (x − p) … dA = −r w + g S r
// Of that a share σ counts: with q = ∇(σ w) and v = ∇(σ g) the derivatives are
//     ū qᵀ + K r vᵀ + σ g K   and   −r qᵀ − σ w I + S r vᵀ + σ g S.
struct far_lanes {
    wide w, g, q[3], v[3]; // w and g times σ
};

LANES_INLINE void add_far_place(struct lane_sums *sums, int at, const struct far_lanes *far,
                                const wide r[3], const wide S[6], const wide Sr[3]) {
    static const int entry[9] = {0, 1, 2, 1, 3, 4, 2, 4, 5};
    for (int i = 0; i < 3; i++) {
        wide_add(sums->place[i] + at, far->g * Sr[i] - far->w * r[i]);
        for (int k = 0; k < 3; k++) {
            wide slope = Sr[i] * far->v[k] - r[i] * far->q[k] + far->g * S[entry[3 * i + k]];
            wide_add(sums->place_slope[3 * i + k] + at, i == k ? slope - far->w : slope);
        }
    }
}

LANES_INLINE void add_far_field(struct lane_sums *sums, int at, const struct far_lanes *far,
                                const wide r[3], const struct block_moments *m) {
    for (int i = 0; i < 3; i++) {
        wide mean = wide_load(m->mean[i] + at), K[3], Kr;
        for (int k = 0; k < 3; k++)
            K[k] = wide_load(m->slope[3 * i + k] + at);
        Kr = wide_dot(K, r);
        wide_add(sums->field[i] + at, mean * far->w + far->g * Kr);
        for (int k = 0; k < 3; k++)
            wide_add(sums->field_slope[3 * i + k] + at,
                     mean * far->q[k] + Kr * far->v[k] + far->g * K[k]);
    }
}

LANES_INLINE void add_far(struct lane_sums *sums, const struct opening *open, int at,
                          const struct wide_shares *whole) {
    const struct surface_block *block = open->block;
    wide r[3], inverse = wide_load(open->inverse + at), area = wide_load(block->area + at);
    wide S[6], Sr[3], share = whole->value;
    struct far_lanes far;
    for (int i = 0; i < 3; i++)
        r[i] = wide_load(open->r[i] + at);
    for (int i = 0; i < 6; i++)
        S[i] = wide_load(block->spread[i] + at);
    Sr[0] = S[0] * r[0] + S[1] * r[1] + S[2] * r[2];
    Sr[1] = S[1] * r[0] + S[3] * r[1] + S[4] * r[2];
    Sr[2] = S[2] * r[0] + S[4] * r[1] + S[5] * r[2];
    wide f = inverse * inverse, g = 4 * inverse * f;
    wide h = 6 * inverse * g, k = 8 * inverse * h;
    wide rSr = wide_dot(r, Sr), trace = S[0] + S[3] + S[5];
    wide w = area * f + 0.5 * (h * rSr - g * trace);
    wide along = share * (0.5 * (h * trace - k * rSr) - g * area), across = share * h;
    far.w = share * w;
    far.g = share * g;
    for (int i = 0; i < 3; i++) {
        far.q[i] = along * r[i] + across * Sr[i] + w * whole->slope[i];
        far.v[i] = g * whole->slope[i] - across * r[i];
        wide_add(sums->weight_slope[i] + at, far.q[i]);
    }
    wide_add(sums->weight + at, far.w);
    add_far_place(sums, at, &far, r, S, Sr);
    if (open->moments && open->moments->moves)
        add_far_field(sums, at, &far, r, open->moments);
}

LANES_INLINE void take_far(struct walk *walk, const struct opening *open) {
    for (int at = 0; at < (int)open->block->count; at += WIDE) {
        struct wide_shares whole =
            open->has_parts ? load_shares(&open->whole, at) : spread_share(&open->above);
        if (!open->has_parts || wide_any(whole.value > 0.0))
            add_far(&walk->sums, open, at, &whole);
    }
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
WIDE_TARGET static void walk_parts(struct walk *walk, const struct surface_patch *patch,
                                   const struct share *above) {
    struct surface_patch parts[BLOCK_LANES] = {*patch}, halves[BLOCK_LANES];
    struct surface_block block = {.count = BLOCK_LANES};
    struct block_moments moments = {0};
    struct opening open;
    for (int count = 1; count < BLOCK_LANES; count *= 2) {
        for (int i = 0; i < count; i++)
            halve(&parts[i], halves + 2 * i);
        memcpy(parts, halves, sizeof parts);
    }
    for (int i = 0; i < BLOCK_LANES; i++)
        surface_patch_fill(&parts[i], i, &block, &moments);
    open_block(walk, &block, &moments, above, &open);
    take_far(walk, &open);
    for (int i = 0; open.has_parts && i < BLOCK_LANES; i++)
        if (open.parts.value[i] > 0) {
            struct share share = lane_share(&open.parts, i);
            walk_parts(walk, &parts[i], &share);
        }
}

// ---- near triangles -----------------------------------------------------------------------------

// Triangles as p sees them.
struct wide_triangles {
    wide corner[3][3], moved[3][3]; // from p; displacements
    wide normal[3], height;         // unit; of p above the plane
    wide dual[2][3];                // of the sides from corner 0, in the plane
};

LANES_INLINE void sides_of(struct wide_triangles *t) {
    wide a[3], b[3], m[3];
    for (int i = 0; i < 3; i++) {
        a[i] = t->corner[1][i] - t->corner[0][i];
        b[i] = t->corner[2][i] - t->corner[0][i];
    }
    wide_cross(a, b, m);
    wide scale = 1 / wide_dot(m, m), unit = wide_root(scale);
    wide_cross(b, m, t->dual[0]);
    wide_cross(m, a, t->dual[1]);
    for (int i = 0; i < 3; i++) {
        t->normal[i] = m[i] * unit;
        t->dual[0][i] *= scale;
        t->dual[1][i] *= scale;
    }
    t->height = -wide_dot(t->normal, t->corner[0]);
}

// Lanes that do not count get a triangle that does no harm.
LANES_INLINE void load_triangles(const struct walk *walk, const struct surface_block *block, int at,
                                 const struct block_shares *shares, struct wide_triangles *out) {
    const struct mesh *mesh = walk->blocks->mesh;
    const double p[3] = {walk->p.x, walk->p.y, walk->p.z};
    memset(out->moved, 0, sizeof out->moved);
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 3; i++)
            out->corner[c][i] = wide_of(c != i);
    for (int lane = 0; lane < WIDE; lane++) {
        if (!(shares->value[at + lane] > 0))
            continue;
        const uint32_t *v = mesh->triangles + 3 * (size_t)block->child[at + lane];
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < 3; i++) {
                size_t from = 3 * (size_t)v[c] + (size_t)i;
                out->corner[c][i][lane] = (double)mesh->positions[from] - p[i];
                if (walk->displacement)
                    out->moved[c][i][lane] = (double)walk->displacement[from];
            }
    }
    sides_of(out);
}

// The integrals of r⁻⁴ and of ρ r⁻⁴ over triangles, ρ in the plane from the foot of p, and their
// derivatives by p.
struct wide_closed {
    wide one, one_slope[3];
    wide plane[3], plane_slope[9];
};

// By Gauss's theorem, with q a side's distance from the foot, s along it, p² = q² + h²:
//     T = ∫ ds/r²,  V = ∫ ds/r⁴,  ∫ r⁻⁴ dA = Σ q T/(2h²),  ∫ ρ r⁻⁴ dA = −½ Σ ν T
LANES_INLINE void add_side(const struct wide_triangles *t, int from, wide *sum_qT, wide *sum_qV,
                           struct wide_closed *out) {
    const wide *a = t->corner[from], *b = t->corner[(from + 1) % 3], *n = t->normal;
    wide along[3], across[3], h = t->height;
    for (int i = 0; i < 3; i++)
        along[i] = b[i] - a[i];
    wide length = wide_root(wide_dot(along, along));
    for (int i = 0; i < 3; i++)
        along[i] = along[i] / length;
    wide_cross(along, n, across);
    wide q = wide_dot(a, across), s0 = wide_dot(a, along), s1 = s0 + length;
    wide square = q * q + h * h, p = wide_root(square);
    wide near = 1 / (s0 * s0 + square), far = 1 / (s1 * s1 + square), ends = far - near;
    wide T = wide_angle(square + s0 * s1, p * length) / p;
    wide V = 0.5 * (s1 * far - s0 * near + T) / square;
    *sum_qT += q * T;
    *sum_qV += q * V;
    for (int i = 0; i < 3; i++) {
        out->one_slope[i] -= across[i] * V;
        out->plane[i] -= 0.5 * across[i] * T;
        for (int k = 0; k < 3; k++) {
            wide slope = 2 * V * (q * across[k] - h * n[k]) - ends * along[k];
            out->plane_slope[3 * i + k] -= 0.5 * across[i] * slope;
        }
    }
}

LANES_INLINE void integrate(const struct wide_triangles *t, struct wide_closed *out) {
    wide qT = wide_of(0), qV = wide_of(0), h = t->height;
    memset(out, 0, sizeof *out);
    for (int side = 0; side < 3; side++)
        add_side(t, side, &qT, &qV, out);
    out->one = 0.5 * qT / (h * h);
    for (int i = 0; i < 3; i++)
        out->one_slope[i] -= t->normal[i] * (2 * out->one + qV) / h;
}

LANES_INLINE void count_shares(struct wide_closed *c, const struct wide_shares *shares) {
    for (int k = 0; k < 3; k++)
        c->one_slope[k] = shares->value * c->one_slope[k] + c->one * shares->slope[k];
    c->one *= shares->value;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            c->plane_slope[3 * i + k] =
                shares->value * c->plane_slope[3 * i + k] + c->plane[i] * shares->slope[k];
        c->plane[i] *= shares->value;
    }
}

// u = u0 + Σ Δu_j b_j, b_j linear over the triangle: ∫ b_j r⁻⁴ = dual_j · (∫ ρ r⁻⁴ − ρ0 ∫ r⁻⁴).
LANES_INLINE void add_moved(struct lane_sums *sums, int at, const struct wide_triangles *t,
                            const struct wide_closed *c) {
    wide b[2], by[2][3];
    for (int j = 0; j < 2; j++) {
        const wide *dual = t->dual[j];
        wide start = wide_dot(dual, t->corner[0]);
        b[j] = wide_dot(dual, c->plane) - start * c->one;
        for (int k = 0; k < 3; k++)
            by[j][k] = dual[0] * c->plane_slope[k] + dual[1] * c->plane_slope[3 + k] +
                       dual[2] * c->plane_slope[6 + k] - start * c->one_slope[k] + dual[k] * c->one;
    }
    for (int i = 0; i < 3; i++) {
        wide u = t->moved[0][i], rise[2] = {t->moved[1][i] - u, t->moved[2][i] - u};
        wide_add(sums->field[i] + at, u * c->one + rise[0] * b[0] + rise[1] * b[1]);
        for (int k = 0; k < 3; k++)
            wide_add(sums->field_slope[3 * i + k] + at,
                     u * c->one_slope[k] + rise[0] * by[0][k] + rise[1] * by[1][k]);
    }
}

LANES_INLINE void add_closed(struct walk *walk, int at, const struct wide_triangles *t,
                             const struct wide_shares *shares, bool moves) {
    struct wide_closed c;
    const wide *n = t->normal;
    wide h = t->height;
    integrate(t, &c);
    count_shares(&c, shares);
    wide_add(walk->sums.weight + at, c.one);
    for (int i = 0; i < 3; i++) {
        wide_add(walk->sums.weight_slope[i] + at, c.one_slope[i]);
        wide_add(walk->sums.place[i] + at, c.plane[i] - h * n[i] * c.one);
        for (int k = 0; k < 3; k++)
            wide_add(walk->sums.place_slope[3 * i + k] + at,
                     c.plane_slope[3 * i + k] - n[i] * (n[k] * c.one + h * c.one_slope[k]));
    }
    if (moves)
        add_moved(&walk->sums, at, t, &c);
}

// How much of each triangle its closed integral may stand for; the rest into *out_rest. False where
// there is none.
LANES_INLINE bool split_level(const struct walk *walk, struct wide_triangles *t,
                              struct wide_shares *shares, struct wide_shares *out_rest) {
    const double off[3] = {walk->off.x, walk->off.y, walk->off.z};
    wide h = t->height, level = h * h * (1 / walk->square), by;
    if (!wide_any((level < LEVEL_HIGH) & (shares->value > 0.0)))
        return false;
    wide good = wide_ramp((level - LEVEL_LOW) * (1 / (LEVEL_HIGH - LEVEL_LOW)), &by);
    by = by * (1 / (LEVEL_HIGH - LEVEL_LOW)) * (2 / walk->square);
    struct wide_shares all = *shares;
    shares->value = all.value * good;
    out_rest->value = all.value * (1 - good);
    for (int i = 0; i < 3; i++) {
        wide slope = all.value * by * (h * t->normal[i] - level * off[i]);
        shares->slope[i] = all.slope[i] * good + slope;
        out_rest->slope[i] = all.slope[i] * (1 - good) - slope;
    }
    t->height = wide_choose(good > 0.0, h, wide_of(1)); // what does not count must be finite
    return true;
}

// *shares becomes what is left to their parts.
LANES_INLINE bool take_closed(struct walk *walk, const struct surface_block *block, bool moves,
                              struct block_shares *shares) {
    bool has_rest = false;
    for (int at = 0; at < (int)block->count; at += WIDE) {
        struct wide_triangles t;
        struct wide_shares some = load_shares(shares, at), rest = {0};
        if (!wide_any(some.value > 0.0))
            continue;
        load_triangles(walk, block, at, shares, &t);
        has_rest |= split_level(walk, &t, &some, &rest);
        add_closed(walk, at, &t, &some, moves);
        store_shares(shares, at, &rest);
    }
    return has_rest;
}

LANES_INLINE void walk_triangles(struct walk *walk, const struct surface_block *block, bool moves,
                                 struct block_shares *shares) {
    bool has_rest = take_closed(walk, block, moves, shares);
    for (int i = 0; has_rest && i < (int)block->count; i++)
        if (shares->value[i] > 0) {
            struct surface_patch patch =
                surface_patch_of(walk->blocks->mesh, walk->displacement, block->child[i]);
            struct share share = lane_share(shares, i);
            walk_parts(walk, &patch, &share);
        }
}

// ---- the walk -----------------------------------------------------------------------------------

LANES_INLINE const struct block_moments *moments_of(const struct walk *walk, uint32_t block) {
    return walk->moments ? &walk->moments[block] : NULL;
}

// The parts of a block are opened one after the other before any of them is walked: no opening
// waits for another.
WIDE_TARGET static void walk_block(struct walk *walk, struct opening *open) {
    const struct surface_block *block = open->block;
    struct opening below[BLOCK_LANES];
    int count = 0;
    take_far(walk, open);
    if (!open->has_parts)
        return;
    if (block->is_bottom) {
        walk_triangles(walk, block, open->moments && open->moments->moves, &open->parts);
        return;
    }
    for (int i = 0; i < (int)block->count; i++)
        if (open->parts.value[i] > 0) {
            struct share share = lane_share(&open->parts, i);
            uint32_t child = block->child[i];
            open_block(walk, &walk->blocks->blocks[child], moments_of(walk, child), &share,
                       &below[count++]);
        }
    while (count > 0)
        walk_block(walk, &below[--count]);
}

LANES_INLINE void walk_all(struct walk *walk) {
    const struct share all = {1, {0, 0, 0}};
    struct opening open;
    open_block(walk, walk->blocks->blocks, moments_of(walk, 0), &all, &open);
    walk_block(walk, &open);
}
