#include "wire/mesh_model.h"

#include "test.h"

#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

static bool vertex_lives(const struct model *m, uint32_t vertex, const bool *without) {
    for (int t = 0; t < MODEL_IDS; t++)
        for (int k = 0; k < 3; k++)
            if (m->alive[t] && !(without && without[t]) && m->corners[t][k] == vertex)
                return true;
    return false;
}

static uint32_t triangles_alive(const struct model *m) {
    uint32_t count = 0;
    for (int t = 0; t < MODEL_IDS; t++)
        count += m->alive[t];
    return count;
}

uint64_t model_hash(const struct model *m) {
    uint64_t sum = 0;
    for (uint32_t i = 0; i < MODEL_IDS; i++) {
        uint32_t vertex[4] = {i}, triangle[5] = {i};
        memcpy(vertex + 1, m->positions[i], 12);
        memcpy(triangle + 1, m->corners[i], 12);
        triangle[4] = m->labels[i];
        if (vertex_lives(m, i, NULL))
            sum += XXH3_64bits(vertex, sizeof vertex);
        if (m->alive[i])
            sum += XXH3_64bits(triangle, sizeof triangle);
    }
    return sum;
}

void model_assert_same(const struct tissue *tissue, const struct model *m) {
    uint32_t vertices = 0;
    for (uint32_t i = 0; i < MODEL_IDS; i++) {
        assert_int_equal(tissue_triangle_alive(tissue, i), m->alive[i]);
        if (m->alive[i]) {
            assert_memory_equal(tissue->corners + 3 * i, m->corners[i], 12);
            assert_int_equal(tissue->labels[i], m->labels[i]);
        }
        bool lives = vertex_lives(m, i, NULL);
        assert_int_equal(i < tissue->vertex_bound && tissue->uses[i], lives);
        if (lives)
            assert_memory_equal(tissue->positions + 3 * i, m->positions[i], 12);
        vertices += lives;
    }
    assert_int_equal(tissue->vertex_count, vertices);
    assert_int_equal(tissue->triangle_count, triangles_alive(m));
    assert_int_equal(tissue->hash, model_hash(m));
}

// ---- random changes of it -----------------------------------------------------------------------

static uint32_t below(struct random *r, uint32_t bound) {
    return (uint32_t)(random_bits(r) % bound);
}

static bool chance(struct random *r, double probability) {
    return random_between(r, 0, 1) < probability;
}

static struct mesh_delta with_room(void) {
    return (struct mesh_delta){
        .freed = calloc(MODEL_IDS, sizeof(uint32_t)),
        .vertices = calloc(MODEL_IDS, sizeof(struct delta_vertex)),
        .made = calloc(MODEL_IDS, sizeof(struct delta_triangle)),
        .pieces = calloc(2, sizeof(struct delta_piece)),
    };
}

// Frees some triangles, gives some other corners, and makes new ones.
static void choose_triangles(const struct model *m, struct random *r, double share,
                             struct mesh_delta *out, bool touched[MODEL_IDS]) {
    for (uint32_t t = 0; t < MODEL_IDS; t++) {
        touched[t] = m->alive[t] && chance(r, share);
        if (touched[t] && chance(r, 0.5))
            out->freed[out->freed_count++] = t;
        else if (touched[t] || (!m->alive[t] && chance(r, share / 2)))
            out->made[out->made_count++].id = t;
    }
}

// Among the ids that no triangle has once those are gone; no more of them than made triangles.
static void choose_vertices(const struct model *m, struct random *r, double share,
                            struct mesh_delta *out, const bool touched[MODEL_IDS]) {
    for (uint32_t v = 0; v < MODEL_IDS && out->vertex_count < out->made_count; v++)
        if (chance(r, share) && !vertex_lives(m, v, touched)) {
            struct delta_vertex *vertex = &out->vertices[out->vertex_count++];
            vertex->id = v;
            for (int k = 0; k < 3; k++)
                vertex->position[k] = (float)random_between(r, -50, 50);
        }
}

static void choose_corners(const struct model *m, struct random *r, struct mesh_delta *out) {
    bool usable[MODEL_IDS];
    for (uint32_t v = 0; v < MODEL_IDS; v++)
        usable[v] = vertex_lives(m, v, NULL);
    for (uint32_t i = 0; i < out->vertex_count; i++)
        usable[out->vertices[i].id] = true;
    for (uint32_t i = 0; i < out->made_count; i++) {
        uint32_t *c = out->made[i].corners;
        out->made[i].label = below(r, 3);
        do {
            for (int k = 0; k < 3; k++)
                while (!usable[c[k] = below(r, MODEL_IDS)])
                    ;
            if (i < out->vertex_count) // every new vertex gets a triangle
                c[0] = out->vertices[i].id;
        } while (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]);
    }
}

static void choose_pieces(struct random *r, double share, struct mesh_delta *out) {
    out->piece_count = chance(r, share) + chance(r, share);
    for (uint32_t i = 0; i < out->piece_count; i++) {
        struct delta_piece *piece = &out->pieces[i];
        *piece = (struct delta_piece){.volume_mm3 = 2.5f, .centroid = {1, -2, 3}};
        piece->vertex_count = 4;
        piece->triangle_count = 4;
        piece->positions = calloc(12, sizeof(float));
        piece->triangles = malloc(12 * sizeof(uint32_t));
        memcpy(piece->triangles, (uint32_t[]){0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}, 48);
        for (int k = 0; k < 12; k++)
            piece->positions[k] = (float)random_between(r, -5, 5);
    }
}

static void apply_to_model(struct model *m, const struct mesh_delta *delta) {
    for (uint32_t i = 0; i < delta->freed_count; i++)
        m->alive[delta->freed[i]] = false;
    for (uint32_t i = 0; i < delta->vertex_count; i++)
        memcpy(m->positions[delta->vertices[i].id], delta->vertices[i].position, 12);
    for (uint32_t i = 0; i < delta->made_count; i++) {
        const struct delta_triangle *made = &delta->made[i];
        m->alive[made->id] = true;
        m->labels[made->id] = made->label;
        memcpy(m->corners[made->id], made->corners, 12);
    }
}

struct mesh_delta model_change(struct model *m, struct random *r, double share, uint32_t base) {
    struct mesh_delta delta = with_room();
    bool touched[MODEL_IDS];
    delta.base = base;
    delta.number = base + 1;
    do {
        delta.freed_count = delta.made_count = delta.vertex_count = 0;
        choose_triangles(m, r, share, &delta, touched);
        choose_vertices(m, r, share, &delta, touched);
    } while (delta.vertex_count < 3 && !triangles_alive(m));
    choose_corners(m, r, &delta);
    choose_pieces(r, share, &delta);
    apply_to_model(m, &delta);
    delta.hash = model_hash(m);
    return delta;
}

struct mesh_bytes mesh_bytes_of(const struct mesh_delta *delta) {
    struct mesh_bytes bytes = {.data = malloc(mesh_delta_bound(delta))};
    bytes.size = mesh_delta_encode(delta, bytes.data, mesh_delta_bound(delta));
    bytes.data = realloc(bytes.data, bytes.size);
    return bytes;
}
