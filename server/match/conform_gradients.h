// Conjugate gradients for one CPU level, whose vectors of four doubles the compiler takes from the
// including file. Each lane does what a number of its own would: the same bits for all.
#pragma once

#include "match/conform_parts.h"

#include <string.h>

#define ITERATIONS_MAX 40

#define LANES_INLINE static inline __attribute__((always_inline))

// As conform_solve.
void conform_gradients_plain(struct conform *c, const vec3 *right, double energy, vec3 *out);
void conform_gradients_avx2(struct conform *c, const vec3 *right, double energy, vec3 *out);

LANES_INLINE void apply(const struct columns3 *m, const quad *v, quad *out) {
    *out = m->of[0] * (*v)[0] + m->of[1] * (*v)[1] + m->of[2] * (*v)[2];
}

LANES_INLINE double dot3(const quad *a, const quad *b) {
    quad products = *a * *b;
    return products[0] + products[1] + products[2];
}

LANES_INLINE double dot(const quad *a, const quad *b, uint32_t count) {
    double sum = 0;
    for (uint32_t i = 0; i < count; i++)
        sum += dot3(&a[i], &b[i]);
    return sum;
}

// The diagonal has the contacts' and the smoothing's own part already.
LANES_INLINE void multiply_contacts(const struct conform *c, const quad *x, quad *out) {
    for (uint32_t k = 0; k < c->contact_count; k++) {
        const struct contact *contact = &c->contacts[k];
        quad normal = {contact->normal.x, contact->normal.y, contact->normal.z, 0};
        double at[6], sum = 0;
        for (int i = 0; i < 6; i++) {
            uint32_t slot = contact->slots[i];
            at[i] = slot == MESH_NONE ? 0 : contact->shares[i] * dot3(&normal, &x[slot]);
            sum += at[i];
        }
        for (int i = 0; i < 6; i++)
            if (contact->slots[i] != MESH_NONE)
                out[contact->slots[i]] +=
                    contact->weight * contact->shares[i] * (sum - at[i]) * normal;
    }
}

LANES_INLINE void multiply_bending(const struct conform *c, const quad *x, quad *out) {
    for (uint32_t i = 0; i < c->active_count; i++) {
        uint32_t from = c->first[i], to = c->first[i + 1];
        const struct columns3 bending = c->bending_columns[i];
        double share = 1.0 / (to - from), square = share * share;
        quad others = c->others[i], off = x[i] + -share * others, pull, own;
        apply(&bending, &off, &pull);
        off = share * others;
        apply(&bending, &off, &own);
        out[i] -= own;
        pull = -share * pull;
        for (uint32_t k = from; k < to; k++)
            if (c->columns[k] != MESH_NONE) {
                off = square * x[c->columns[k]];
                apply(&bending, &off, &own);
                out[c->columns[k]] = out[c->columns[k]] + pull - own;
            }
    }
}

LANES_INLINE void multiply(const struct conform *c, const quad *x, quad *out) {
    for (uint32_t i = 0; i < c->active_count; i++) {
        quad sum, part, others = {0};
        apply(&c->diagonal_columns[i], &x[i], &sum);
        for (uint32_t k = c->first[i]; k < c->first[i + 1]; k++)
            if (c->columns[k] != MESH_NONE) {
                const quad *other = &x[c->columns[k]];
                apply(&c->block_columns[k], other, &part);
                sum += part;
                others += *other;
            }
        out[i] = sum;
        c->others[i] = others;
    }
    multiply_contacts(c, x, out);
    multiply_bending(c, x, out);
}

LANES_INLINE double precondition(struct conform *c) {
    for (uint32_t i = 0; i < c->active_count; i++)
        apply(&c->inverse_columns[i], &c->residual[i], &c->preconditioned[i]);
    return dot(c->residual, c->preconditioned, c->active_count);
}

LANES_INLINE void descend(struct conform *c, double share) {
    uint32_t count = c->active_count;
    double energy = precondition(c), least = share * energy;
    memcpy(c->direction, c->preconditioned, count * sizeof *c->direction);
    for (int i = 0; i < ITERATIONS_MAX && energy > least; i++) {
        multiply(c, c->direction, c->product);
        double curvature = dot(c->direction, c->product, count);
        if (!(curvature > 0))
            break;
        double step = energy / curvature;
        for (uint32_t k = 0; k < count; k++) {
            c->solution[k] += step * c->direction[k];
            c->residual[k] += -step * c->product[k];
        }
        double before = energy;
        energy = precondition(c);
        double kept = energy / before;
        for (uint32_t k = 0; k < count; k++)
            c->direction[k] = c->preconditioned[k] + kept * c->direction[k];
    }
}

LANES_INLINE void columns_of(const struct sym3 *m, uint32_t count, struct columns3 *out) {
    for (uint32_t i = 0; i < count; i++)
        out[i] = (struct columns3){{{m[i].xx, m[i].xy, m[i].xz, 0},
                                    {m[i].xy, m[i].yy, m[i].yz, 0},
                                    {m[i].xz, m[i].yz, m[i].zz, 0}}};
}

LANES_INLINE void solve(struct conform *c, const vec3 *right, double energy, vec3 *out) {
    uint32_t count = c->active_count;
    columns_of(c->blocks, c->first[count], c->block_columns);
    columns_of(c->diagonal, count, c->diagonal_columns);
    columns_of(c->inverse, count, c->inverse_columns);
    columns_of(c->bending, count, c->bending_columns);
    for (uint32_t i = 0; i < count; i++) {
        c->solution[i] = (quad){0};
        c->residual[i] = (quad){right[i].x, right[i].y, right[i].z, 0};
    }
    descend(c, energy);
    for (uint32_t i = 0; i < count; i++)
        out[i] = (vec3){c->solution[i][0], c->solution[i][1], c->solution[i][2]};
}
