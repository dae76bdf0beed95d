// A change of a mesh, alone and made to a small one, and a piece of a mesh.
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "wire/tissue.h"
#include "wire/wire.h"

#include <stdlib.h>
#include <string.h>

static uint8_t *encode(const struct mesh_delta *delta, size_t *out_size) {
    size_t bound = mesh_delta_bound(delta);
    uint8_t *bytes = alloc(bound, 1);
    *out_size = mesh_delta_encode(delta, bytes, bound);
    return bytes;
}

// What was read can be written, and is then read as the same.
static void there_and_back(const struct mesh_delta *delta) {
    struct mesh_delta again;
    size_t size, used, size_again;
    uint8_t *bytes = encode(delta, &size);
    CHECK(mesh_delta_decode(bytes, size, &used, &again, NULL) == RESULT_OK && used == size);
    uint8_t *bytes_again = encode(&again, &size_again);
    CHECK(size_again == size && !memcmp(bytes_again, bytes, size));
    mesh_delta_fini(&again);
    free(bytes);
    free(bytes_again);
}

// Two triangles over four vertices.
static void make_small(struct tissue *out) {
    struct delta_vertex vertices[] = {
        {0, {0, 0, 0}}, {1, {1, 0, 0}}, {2, {0, 1, 0}}, {3, {1, 1, 0}}};
    struct delta_triangle made[] = {{0, {0, 1, 2}, 0}, {1, {1, 3, 2}, 0}};
    struct mesh_delta delta = {
        .number = 1, .vertex_count = 4, .vertices = vertices, .made_count = 2, .made = made};
    *out = (struct tissue){0};
    CHECK(tissue_change(out, &delta, NULL) == RESULT_OK);
}

// The mesh that a change made is the one that it says whole.
static void made_whole(const struct tissue *tissue) {
    struct tissue other = {0};
    struct mesh_delta whole;
    tissue_whole(tissue, &whole);
    CHECK(mesh_delta_validate(&whole, NULL) == RESULT_OK);
    CHECK(tissue_change(&other, &whole, NULL) == RESULT_OK);
    CHECK(other.hash == tissue->hash && other.vertex_count == tissue->vertex_count &&
          other.triangle_count == tissue->triangle_count);
    mesh_delta_fini(&whole);
    tissue_fini(&other);
}

static void change(const uint8_t *data, size_t size) {
    struct mesh_delta delta;
    struct tissue tissue;
    struct error err;
    size_t used;
    if (mesh_delta_decode(data, size, &used, &delta, &err) != RESULT_OK)
        return;
    CHECK(used <= size);
    there_and_back(&delta);
    make_small(&tissue);
    enum result result = tissue_change(&tissue, &delta, &err);
    if (result == RESULT_OK)
        made_whole(&tissue);
    else
        CHECK((result == RESULT_MISSING) == (tissue.number == 1));
    tissue_fini(&tissue);
    mesh_delta_fini(&delta);
}

static void payload(const uint8_t *data, size_t size) {
    struct tissue tissue;
    struct error err;
    make_small(&tissue);
    enum result result = tissue_apply(&tissue, data, size, &err);
    CHECK(result == RESULT_OK || result == RESULT_MISSING || !tissue.number);
    tissue_fini(&tissue);
}

static void chunk(const uint8_t *data, size_t size) {
    static arthron_MeshChunk message, again;
    static uint8_t encoded[WIRE_CHUNK_MAX];
    struct error err;
    size_t used;
    if (!wire_is_chunk(data, size) || wire_decode_chunk(data, size, &message, &err) != RESULT_OK)
        return;
    CHECK(message.data.size <= message.size && message.number > message.base);
    CHECK(wire_encode_chunk(&message, encoded, sizeof encoded, &used) == RESULT_OK);
    CHECK(wire_decode_chunk(encoded, used, &again, &err) == RESULT_OK);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    change(data, size);
    payload(data, size);
    chunk(data, size);
    return 0;
}
