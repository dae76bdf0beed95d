#include "match/conform_parts.h"
#include "match/room.h"

#include <math.h>
#include <string.h>

#define TOTAL 0.002 // of a vertex's whole displacement
#define TANGENTIAL 0.04
#define FULL 0.005
#define DIAGONAL 1e-4

void conform_begin_system(struct conform *c) {
    c->first[0] = 0;
    for (uint32_t i = 0; i < c->active_count; i++)
        c->first[i + 1] = c->first[i] + conform_degree(c, c->active[i]);
    uint32_t count = c->first[c->active_count], room = c->block_room, again = room;
    room_for(&c->blocks, &room, count);
    room_for(&c->block_columns, &again, count);
    room_for(&c->columns, &c->block_room, count);
    for (uint32_t i = 0; i < c->active_count; i++)
        for (uint32_t k = 0; k < conform_degree(c, c->active[i]); k++) {
            uint32_t to = c->surface->opposites[c->surface->first[c->active[i]] + k].from;
            c->columns[c->first[i] + k] = c->slot[to];
        }
}

void conform_clear_system(struct conform *c) {
    memset(c->blocks, 0, c->first[c->active_count] * sizeof *c->blocks);
    memset(c->diagonal, 0, c->active_count * sizeof *c->diagonal);
    memset(c->gradient, 0, c->active_count * sizeof *c->gradient);
}

// ---- the matrix ---------------------------------------------------------------------------------

static void add_block(struct conform *c, uint32_t i, uint32_t j, double s, struct sym3 m) {
    for (uint32_t k = c->first[i]; k < c->first[i + 1]; k++)
        if (c->columns[k] == j) {
            sym3_add(&c->blocks[k], s, m);
            return;
        }
}

void conform_add_rows(struct conform *c) {
    static const int one[6] = {0, 0, 0, 1, 1, 2}, other[6] = {0, 1, 2, 1, 2, 2};
    for (uint32_t t = 0; t < c->live_count; t++) {
        const uint32_t *v = c->surface->triangles + 3 * (size_t)c->live[t];
        for (int k = 0; k < 6; k++) {
            uint32_t i = c->slot[v[one[k]]], j = c->slot[v[other[k]]];
            if (i == MESH_NONE || j == MESH_NONE)
                continue;
            if (i == j) {
                sym3_add(&c->diagonal[i], 1, c->rows[t].pairs[k]);
                continue;
            }
            add_block(c, i, j, 1, c->rows[t].pairs[k]);
            add_block(c, j, i, 1, c->rows[t].pairs[k]);
        }
        for (int k = 0; k < 3; k++)
            if (c->slot[v[k]] != MESH_NONE)
                c->gradient[c->slot[v[k]]] =
                    vec3_add(c->gradient[c->slot[v[k]]], c->rows[t].gradient[k]);
    }
}

static void add_contacts(struct conform *c) {
    for (uint32_t k = 0; k < c->contact_count; k++) {
        const struct contact *contact = &c->contacts[k];
        struct sym3 square = sym3_outer(contact->normal);
        for (int i = 0; i < 6; i++) {
            uint32_t slot = contact->slots[i];
            if (slot == MESH_NONE)
                continue;
            double share = contact->weight * contact->shares[i];
            sym3_add(&c->diagonal[slot], share * contact->shares[i], square);
            c->gradient[slot] =
                vec3_add_scaled(c->gradient[slot], -share * contact->push, contact->normal);
        }
    }
}

// What a vertex's distance from the middle of its neighbours costs.
static vec3 off_middle(const struct conform *c, uint32_t vertex) {
    vec3 sum = {0};
    for (uint32_t k = c->surface->first[vertex]; k < c->surface->first[vertex + 1]; k++)
        sum = vec3_add(sum, c->positions[c->surface->opposites[k].from]);
    return vec3_add_scaled(c->positions[vertex], -1.0 / conform_degree(c, vertex), sum);
}

static void add_bending(struct conform *c, uint32_t i) {
    uint32_t v = c->active[i], degree = c->first[i + 1] - c->first[i];
    struct sym3 m = sym3_identity(TANGENTIAL + FULL + c->bend[v]);
    sym3_add(&m, -TANGENTIAL, sym3_outer(c->normals[v]));
    c->bending[i] = m;
    vec3 pull = sym3_apply(m, off_middle(c, v));
    sym3_add(&c->diagonal[i], 1, m);
    c->gradient[i] = vec3_add(c->gradient[i], pull);
    for (uint32_t k = c->first[i]; k < c->first[i + 1]; k++)
        if (c->columns[k] != MESH_NONE) {
            uint32_t j = c->columns[k];
            sym3_add(&c->diagonal[j], 1.0 / degree / degree, m);
            c->gradient[j] = vec3_add_scaled(c->gradient[j], -1.0 / degree, pull);
        }
}

static struct sym3 inverse(struct sym3 m) {
    double a = m.yy * m.zz - m.yz * m.yz, b = m.xz * m.yz - m.xy * m.zz;
    double d = m.xy * m.yz - m.xz * m.yy, det = m.xx * a + m.xy * b + m.xz * d;
    if (!(det > 0))
        return sym3_identity(1 / (m.xx + m.yy + m.zz));
    double s = 1 / det;
    return (struct sym3){s * a,
                         s * b,
                         s * d,
                         s * (m.xx * m.zz - m.xz * m.xz),
                         s * (m.xy * m.xz - m.xx * m.yz),
                         s * (m.xx * m.yy - m.xy * m.xy)};
}

void conform_add_smoothing(struct conform *c, double stiffness) {
    for (uint32_t i = 0; i < c->active_count; i++) {
        uint32_t v = c->active[i];
        double degree = conform_degree(c, v);
        sym3_add(&c->diagonal[i], 1, sym3_identity(stiffness * degree + TOTAL + DIAGONAL));
        c->gradient[i] =
            vec3_add_scaled(c->gradient[i], TOTAL, vec3_sub(c->positions[v], c->surface->start[v]));
        for (uint32_t k = c->first[i]; k < c->first[i + 1]; k++)
            if (c->columns[k] != MESH_NONE)
                sym3_add(&c->blocks[k], -stiffness, sym3_identity(1));
    }
    add_contacts(c);
    for (uint32_t i = 0; i < c->active_count; i++)
        add_bending(c, i);
    for (uint32_t i = 0; i < c->active_count; i++)
        c->inverse[i] = inverse(c->diagonal[i]);
}
