#include "wire/tissue.h"

#include "base/bytes.h"
#include "base/check.h"

#include <stdlib.h>
#include <string.h>
#define XXH_INLINE_ALL // records are so short that a call would cost as much
#include <xxhash.h>

#define VERTEX_RECORD 16   // bytes
#define TRIANGLE_RECORD 20 // not as long: no vertex hashes like a triangle

void tissue_fini(struct tissue *tissue) {
    free(tissue->positions);
    free(tissue->uses);
    free(tissue->corners);
    free(tissue->labels);
    *tissue = (struct tissue){0};
}

static void *copy_of(const void *items, uint32_t count, size_t size) {
    void *copy = alloc(count, size);
    if (count)
        memcpy(copy, items, count * size);
    return copy;
}

void tissue_copy(struct tissue *out, const struct tissue *tissue) {
    *out = *tissue;
    out->positions = copy_of(tissue->positions, tissue->vertex_bound, 3 * sizeof(float));
    out->uses = copy_of(tissue->uses, tissue->vertex_bound, sizeof(uint32_t));
    out->corners = copy_of(tissue->corners, tissue->triangle_bound, 3 * sizeof(uint32_t));
    out->labels = copy_of(tissue->labels, tissue->triangle_bound, sizeof(uint32_t));
}

// ---- hashes -------------------------------------------------------------------------------------

static uint64_t vertex_hash(const struct tissue *tissue, uint32_t vertex) {
    uint8_t record[VERTEX_RECORD];
    struct writer w = {.data = record, .size = sizeof record};
    write_u32(&w, vertex);
    for (int k = 0; k < 3; k++) {
        uint32_t bits;
        memcpy(&bits, &tissue->positions[3 * (size_t)vertex + (size_t)k], sizeof bits);
        write_u32(&w, bits);
    }
    return XXH3_64bits(record, sizeof record);
}

static uint64_t triangle_hash(const struct tissue *tissue, uint32_t triangle) {
    uint8_t record[TRIANGLE_RECORD];
    struct writer w = {.data = record, .size = sizeof record};
    write_u32(&w, triangle);
    for (int k = 0; k < 3; k++)
        write_u32(&w, tissue->corners[3 * (size_t)triangle + (size_t)k]);
    write_u32(&w, tissue->labels[triangle]);
    return XXH3_64bits(record, sizeof record);
}

uint64_t tissue_payload_hash(const uint8_t *data, size_t size) {
    return XXH3_64bits(data, size);
}

// ---- one triangle -------------------------------------------------------------------------------

static void drop_triangle(struct tissue *tissue, uint32_t triangle) {
    uint32_t *corners = tissue->corners + 3 * (size_t)triangle;
    tissue->hash -= triangle_hash(tissue, triangle);
    tissue->triangle_count--;
    for (int k = 0; k < 3; k++)
        if (--tissue->uses[corners[k]] == 0) {
            tissue->hash -= vertex_hash(tissue, corners[k]);
            tissue->vertex_count--;
        }
    memset(corners, 0, 3 * sizeof *corners);
}

static void put_triangle(struct tissue *tissue, const struct delta_triangle *made) {
    memcpy(tissue->corners + 3 * (size_t)made->id, made->corners, sizeof made->corners);
    tissue->labels[made->id] = made->label;
    tissue->hash += triangle_hash(tissue, made->id);
    tissue->triangle_count++;
    for (int k = 0; k < 3; k++)
        if (tissue->uses[made->corners[k]]++ == 0) {
            tissue->hash += vertex_hash(tissue, made->corners[k]);
            tissue->vertex_count++;
        }
}

// ---- changes ------------------------------------------------------------------------------------

static void *grown(void *items, uint32_t old_count, uint32_t count, size_t size) {
    uint8_t *larger = alloc_resize(items, count, size);
    memset(larger + old_count * size, 0, (count - old_count) * size);
    return larger;
}

// Room for the ids of a change, which are ascending.
static void make_room(struct tissue *t, const struct mesh_delta *delta) {
    uint32_t vertices = delta->vertex_count ? delta->vertices[delta->vertex_count - 1].id + 1 : 0;
    uint32_t triangles = delta->made_count ? delta->made[delta->made_count - 1].id + 1 : 0;
    if (vertices > t->vertex_bound) {
        t->positions = grown(t->positions, t->vertex_bound, vertices, 3 * sizeof(float));
        t->uses = grown(t->uses, t->vertex_bound, vertices, sizeof(uint32_t));
        t->vertex_bound = vertices;
    }
    if (triangles > t->triangle_bound) {
        t->corners = grown(t->corners, t->triangle_bound, triangles, 3 * sizeof(uint32_t));
        t->labels = grown(t->labels, t->triangle_bound, triangles, sizeof(uint32_t));
        t->triangle_bound = triangles;
    }
}

static enum result free_triangles(struct tissue *tissue, const struct mesh_delta *delta,
                                  struct error *err) {
    for (uint32_t i = 0; i < delta->freed_count; i++) {
        if (!tissue_triangle_alive(tissue, delta->freed[i]))
            return fail(err, RESULT_INVALID, "it frees triangle %u, which is not alive",
                        delta->freed[i]);
        drop_triangle(tissue, delta->freed[i]);
    }
    for (uint32_t i = 0; i < delta->made_count; i++)
        if (tissue_triangle_alive(tissue, delta->made[i].id))
            drop_triangle(tissue, delta->made[i].id);
    return RESULT_OK;
}

static enum result add_vertices(struct tissue *tissue, const struct mesh_delta *delta,
                                struct error *err) {
    for (uint32_t i = 0; i < delta->vertex_count; i++) {
        const struct delta_vertex *vertex = &delta->vertices[i];
        if (tissue->uses[vertex->id])
            return fail(err, RESULT_INVALID, "new vertex %u has the id of a living one",
                        vertex->id);
        memcpy(tissue->positions + 3 * (size_t)vertex->id, vertex->position,
               sizeof vertex->position);
    }
    return RESULT_OK;
}

// In the order of ids, which both lists have.
static bool is_new(const struct mesh_delta *delta, uint32_t vertex) {
    uint32_t low = 0, high = delta->vertex_count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (delta->vertices[middle].id < vertex)
            low = middle + 1;
        else
            high = middle;
    }
    return low < delta->vertex_count && delta->vertices[low].id == vertex;
}

// Before anything is freed: a vertex may lose all its triangles and get others.
static enum result delta_corners_check(const struct tissue *tissue, const struct mesh_delta *delta,
                                       struct error *err) {
    for (uint32_t i = 0; i < delta->made_count; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t corner = delta->made[i].corners[k];
            bool lives = corner < tissue->vertex_bound && tissue->uses[corner];
            if (!lives && !is_new(delta, corner))
                return fail(err, RESULT_INVALID, "triangle %u has corner %u, which is not alive",
                            delta->made[i].id, corner);
        }
    return RESULT_OK;
}

static enum result put_triangles(struct tissue *tissue, const struct mesh_delta *delta,
                                 struct error *err) {
    for (uint32_t i = 0; i < delta->made_count; i++)
        put_triangle(tissue, &delta->made[i]);
    for (uint32_t i = 0; i < delta->vertex_count; i++)
        if (!tissue->uses[delta->vertices[i].id])
            return fail(err, RESULT_INVALID, "new vertex %u has no triangle",
                        delta->vertices[i].id);
    return RESULT_OK;
}

enum result tissue_change(struct tissue *tissue, const struct mesh_delta *delta,
                          struct error *err) {
    if (delta->base && delta->base != tissue->number)
        return fail(err, RESULT_MISSING, "it changes number %u, and number %u is here", delta->base,
                    tissue->number);
    if (!delta->base)
        tissue_fini(tissue);
    enum result result = delta_corners_check(tissue, delta, err);
    if (result == RESULT_OK)
        result = free_triangles(tissue, delta, err);
    make_room(tissue, delta);
    if (result == RESULT_OK)
        result = add_vertices(tissue, delta, err);
    if (result == RESULT_OK)
        result = put_triangles(tissue, delta, err);
    if (result == RESULT_OK)
        tissue->number = delta->number;
    else
        tissue_fini(tissue);
    return result;
}

static enum result apply_one(struct tissue *tissue, const uint8_t *data, size_t size,
                             size_t *out_used, struct error *err) {
    struct mesh_delta delta;
    enum result result = mesh_delta_decode(data, size, out_used, &delta, err);
    if (result != RESULT_OK)
        return result;
    result = tissue_change(tissue, &delta, err);
    if (result == RESULT_OK && tissue->hash != delta.hash)
        result = fail(err, RESULT_CORRUPT, "the mesh's hash is not the one told");
    if (result != RESULT_OK)
        fail_in(err, result, "change to number %u: ", delta.number);
    mesh_delta_fini(&delta);
    return result;
}

enum result tissue_apply(struct tissue *tissue, const uint8_t *data, size_t size,
                         struct error *err) {
    enum result result = RESULT_OK;
    for (size_t used = 0; size > 0 && result == RESULT_OK; data += used, size -= used)
        result = apply_one(tissue, data, size, &used, err);
    if (result != RESULT_OK && result != RESULT_MISSING)
        tissue_fini(tissue);
    return result;
}

// ---- all of it ----------------------------------------------------------------------------------

void tissue_whole(const struct tissue *tissue, struct mesh_delta *out) {
    *out = (struct mesh_delta){.number = tissue->number, .hash = tissue->hash};
    out->vertices = alloc(tissue->vertex_count, sizeof *out->vertices);
    out->made = alloc(tissue->triangle_count, sizeof *out->made);
    for (uint32_t i = 0; i < tissue->vertex_bound; i++)
        if (tissue->uses[i]) {
            struct delta_vertex *vertex = &out->vertices[out->vertex_count++];
            vertex->id = i;
            memcpy(vertex->position, tissue->positions + 3 * (size_t)i, sizeof vertex->position);
        }
    for (uint32_t i = 0; i < tissue->triangle_bound; i++)
        if (tissue_triangle_alive(tissue, i)) {
            struct delta_triangle *made = &out->made[out->made_count++];
            *made = (struct delta_triangle){.id = i, .label = tissue->labels[i]};
            memcpy(made->corners, tissue->corners + 3 * (size_t)i, sizeof made->corners);
        }
}
