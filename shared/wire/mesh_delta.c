#include "wire/mesh_delta.h"

#include "base/bytes.h"
#include "base/check.h"
#include "wire/varint.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define VARINT_MAX 5 // bytes
#define FLOAT_SIZE 4
#define HASH_SIZE 8
#define FREED_MIN 1 // bytes of one, at least
#define VERTEX_MIN (1 + 3 * FLOAT_SIZE)
#define MADE_MIN 4
#define PIECE_MIN (4 * FLOAT_SIZE + 2)

void mesh_delta_fini(struct mesh_delta *delta) {
    for (uint32_t i = 0; i < delta->piece_count; i++) {
        free(delta->pieces[i].positions);
        free(delta->pieces[i].triangles);
    }
    free(delta->freed);
    free(delta->vertices);
    free(delta->made);
    free(delta->pieces);
    *delta = (struct mesh_delta){0};
}

// ---- what a change must be ----------------------------------------------------------------------

static bool is_within_reach(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (!(fabsf(values[i]) <= MESH_DELTA_REACH_MM)) // NaN too
            return false;
    return true;
}

// *next: the lowest that may come.
static enum result id_check(uint32_t id, uint32_t *next, struct error *err) {
    if (id >= MESH_DELTA_IDS_MAX)
        return fail(err, RESULT_LIMIT, "id %u is not below %u", id, MESH_DELTA_IDS_MAX);
    if (id < *next)
        return fail(err, RESULT_FORMAT, "id %u is not above the one before", id);
    *next = id + 1;
    return RESULT_OK;
}

static enum result corners_check(const uint32_t corners[3], uint32_t bound, struct error *err) {
    for (int k = 0; k < 3; k++)
        if (corners[k] >= bound)
            return fail(err, RESULT_LIMIT, "corner %u is not below %u", corners[k], bound);
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0])
        return fail(err, RESULT_FORMAT, "corners %u, %u, %u are not three", corners[0], corners[1],
                    corners[2]);
    return RESULT_OK;
}

static enum result vertices_check(const struct mesh_delta *delta, struct error *err) {
    uint32_t next = 0;
    enum result result = RESULT_OK;
    for (uint32_t i = 0; i < delta->vertex_count && result == RESULT_OK; i++) {
        const struct delta_vertex *vertex = &delta->vertices[i];
        result = id_check(vertex->id, &next, err);
        if (result == RESULT_OK && !is_within_reach(vertex->position, 3))
            result = fail(err, RESULT_FORMAT, "a coordinate of %u is out of range", vertex->id);
    }
    return result == RESULT_OK ? result : fail_in(err, result, "new vertices: ");
}

static enum result triangles_check(const struct mesh_delta *delta, struct error *err) {
    uint32_t next = 0;
    enum result result = RESULT_OK;
    for (uint32_t i = 0; i < delta->freed_count && result == RESULT_OK; i++)
        result = id_check(delta->freed[i], &next, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "freed triangles: ");
    next = 0;
    for (uint32_t i = 0; i < delta->made_count && result == RESULT_OK; i++) {
        result = id_check(delta->made[i].id, &next, err);
        if (result == RESULT_OK)
            result = corners_check(delta->made[i].corners, MESH_DELTA_IDS_MAX, err);
    }
    return result == RESULT_OK ? result : fail_in(err, result, "made triangles: ");
}

static enum result piece_check(const struct delta_piece *piece, struct error *err) {
    enum result result = RESULT_OK;
    if (!isfinite(piece->volume_mm3) || !is_within_reach(piece->centroid, 3) ||
        !is_within_reach(piece->positions, 3 * (size_t)piece->vertex_count))
        return fail(err, RESULT_FORMAT, "its volume or a coordinate is out of range");
    for (uint32_t i = 0; i < piece->triangle_count && result == RESULT_OK; i++)
        result = corners_check(piece->triangles + 3 * (size_t)i, piece->vertex_count, err);
    return result;
}

enum result mesh_delta_validate(const struct mesh_delta *delta, struct error *err) {
    if (delta->number <= delta->base)
        return fail(err, RESULT_FORMAT, "number %u is not above %u, which it changes",
                    delta->number, delta->base);
    if (delta->piece_count > MESH_DELTA_PIECES_MAX)
        return fail(err, RESULT_LIMIT, "%u pieces, at most %d are accepted", delta->piece_count,
                    MESH_DELTA_PIECES_MAX);
    enum result result = triangles_check(delta, err);
    if (result == RESULT_OK)
        result = vertices_check(delta, err);
    for (uint32_t i = 0; i < delta->piece_count && result == RESULT_OK; i++) {
        result = piece_check(&delta->pieces[i], err);
        if (result != RESULT_OK)
            fail_in(err, result, "piece %u: ", i);
    }
    return result;
}

// ---- encoding -----------------------------------------------------------------------------------

// The difference from the value before, small where either is a little larger than the other.
static void write_difference(struct writer *w, uint32_t value, uint32_t *last) {
    uint32_t difference = value - *last;
    *last = value;
    write_varint(w, zigzag(difference));
}

static void write_floats(struct writer *w, const float *values, size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        write_u32(w, bits);
    }
}

// How many ids were left out; *next is the lowest that may come.
static uint32_t gap_to(uint32_t id, uint32_t *next) {
    CHECK(id >= *next && id < MESH_DELTA_IDS_MAX);
    uint32_t gap = id - *next;
    *next = id + 1;
    return gap;
}

static void write_made(struct writer *w, const struct mesh_delta *delta) {
    uint32_t next = 0, corner = 0, label = 0;
    write_varint(w, delta->made_count);
    for (uint32_t i = 0; i < delta->made_count; i++) {
        const struct delta_triangle *made = &delta->made[i];
        bool relabels = made->label != label;
        write_varint(w, gap_to(made->id, &next) << 1 | relabels);
        if (relabels)
            write_difference(w, made->label, &label);
        for (int k = 0; k < 3; k++)
            write_difference(w, made->corners[k], &corner);
    }
}

static void write_piece(struct writer *w, const struct delta_piece *piece) {
    uint32_t corner = 0;
    write_floats(w, &piece->volume_mm3, 1);
    write_floats(w, piece->centroid, 3);
    write_varint(w, piece->vertex_count);
    write_floats(w, piece->positions, 3 * (size_t)piece->vertex_count);
    write_varint(w, piece->triangle_count);
    for (size_t i = 0; i < 3 * (size_t)piece->triangle_count; i++)
        write_difference(w, piece->triangles[i], &corner);
}

size_t mesh_delta_bound(const struct mesh_delta *delta) {
    size_t bound = 6 * VARINT_MAX + HASH_SIZE;
    bound += (size_t)delta->freed_count * VARINT_MAX;
    bound += (size_t)delta->vertex_count * (VARINT_MAX + 3 * FLOAT_SIZE);
    bound += (size_t)delta->made_count * 5 * VARINT_MAX;
    for (uint32_t i = 0; i < delta->piece_count; i++)
        bound += 4 * FLOAT_SIZE + 2 * VARINT_MAX +
                 (size_t)delta->pieces[i].vertex_count * 3 * FLOAT_SIZE +
                 (size_t)delta->pieces[i].triangle_count * 3 * VARINT_MAX;
    return bound;
}

size_t mesh_delta_encode(const struct mesh_delta *delta, uint8_t *data, size_t size) {
    struct writer w = {.data = data, .size = size};
    uint32_t freed = 0, vertex = 0;
    CHECK(delta->number > delta->base);
    write_varint(&w, delta->base);
    write_varint(&w, delta->number - delta->base - 1);
    write_varint(&w, delta->freed_count);
    for (uint32_t i = 0; i < delta->freed_count; i++)
        write_varint(&w, gap_to(delta->freed[i], &freed));
    write_varint(&w, delta->vertex_count);
    for (uint32_t i = 0; i < delta->vertex_count; i++) {
        write_varint(&w, gap_to(delta->vertices[i].id, &vertex));
        write_floats(&w, delta->vertices[i].position, 3);
    }
    write_made(&w, delta);
    write_varint(&w, delta->piece_count);
    for (uint32_t i = 0; i < delta->piece_count; i++)
        write_piece(&w, &delta->pieces[i]);
    write_u64(&w, delta->hash);
    CHECK(!w.overflow);
    return w.used;
}

// ---- decoding -----------------------------------------------------------------------------------

// Where there is none, or one beyond 32 bits, the reader underflows.
static uint32_t read_varint(struct reader *r) {
    uint64_t value = 0;
    for (int i = 0; i < VARINT_MAX; i++) {
        uint8_t byte = read_u8(r);
        value |= (uint64_t)(byte & 0x7f) << (7 * i);
        if (byte < 0x80 && value <= UINT32_MAX)
            return (uint32_t)value;
    }
    r->underflow = true;
    return 0;
}

static uint32_t read_difference(struct reader *r, uint32_t *last) {
    uint32_t coded = read_varint(r);
    *last += coded >> 1 ^ (coded & 1 ? UINT32_MAX : 0);
    return *last;
}

static void read_floats(struct reader *r, float *out_values, size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint32_t bits = read_u32(r);
        memcpy(&out_values[i], &bits, sizeof bits);
    }
}

static enum result end_check(const struct reader *r, struct error *err) {
    if (!r->underflow)
        return RESULT_OK;
    return fail(err, RESULT_FORMAT, "cut short, or a number beyond 32 bits");
}

// A list's length, which the bytes that follow can hold.
static enum result read_count(struct reader *r, size_t least_size, uint32_t *out_count,
                              struct error *err) {
    *out_count = 0;
    uint32_t count = read_varint(r);
    if (end_check(r, err) != RESULT_OK)
        return RESULT_FORMAT;
    if (count > (r->size - r->used) / least_size)
        return fail(err, RESULT_FORMAT, "%u of them do not fit the bytes that follow", count);
    *out_count = count;
    return RESULT_OK;
}

static enum result read_freed(struct reader *r, struct mesh_delta *delta, struct error *err) {
    uint32_t next = 0;
    if (read_count(r, FREED_MIN, &delta->freed_count, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "freed triangles: ");
    delta->freed = alloc(delta->freed_count, sizeof *delta->freed);
    for (uint32_t i = 0; i < delta->freed_count; i++, next++)
        delta->freed[i] = next += read_varint(r);
    return RESULT_OK;
}

static enum result read_vertices(struct reader *r, struct mesh_delta *delta, struct error *err) {
    uint32_t next = 0;
    if (read_count(r, VERTEX_MIN, &delta->vertex_count, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "new vertices: ");
    delta->vertices = alloc(delta->vertex_count, sizeof *delta->vertices);
    for (uint32_t i = 0; i < delta->vertex_count; i++, next++) {
        delta->vertices[i].id = next += read_varint(r);
        read_floats(r, delta->vertices[i].position, 3);
    }
    return RESULT_OK;
}

static enum result read_made(struct reader *r, struct mesh_delta *delta, struct error *err) {
    uint32_t next = 0, corner = 0, label = 0;
    if (read_count(r, MADE_MIN, &delta->made_count, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "made triangles: ");
    delta->made = alloc(delta->made_count, sizeof *delta->made);
    for (uint32_t i = 0; i < delta->made_count; i++, next++) {
        struct delta_triangle *made = &delta->made[i];
        uint32_t head = read_varint(r);
        made->id = next += head >> 1;
        made->label = head & 1 ? read_difference(r, &label) : label;
        for (int k = 0; k < 3; k++)
            made->corners[k] = read_difference(r, &corner);
    }
    return RESULT_OK;
}

static enum result read_piece(struct reader *r, struct delta_piece *piece, struct error *err) {
    uint32_t corner = 0;
    read_floats(r, &piece->volume_mm3, 1);
    read_floats(r, piece->centroid, 3);
    if (read_count(r, 3 * FLOAT_SIZE, &piece->vertex_count, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "vertices: ");
    piece->positions = alloc(3 * (size_t)piece->vertex_count, sizeof *piece->positions);
    read_floats(r, piece->positions, 3 * (size_t)piece->vertex_count);
    if (read_count(r, 3, &piece->triangle_count, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "triangles: ");
    piece->triangles = alloc(3 * (size_t)piece->triangle_count, sizeof *piece->triangles);
    for (size_t i = 0; i < 3 * (size_t)piece->triangle_count; i++)
        piece->triangles[i] = read_difference(r, &corner);
    return RESULT_OK;
}

static enum result read_pieces(struct reader *r, struct mesh_delta *delta, struct error *err) {
    if (read_count(r, PIECE_MIN, &delta->piece_count, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "pieces: ");
    delta->pieces = alloc(delta->piece_count, sizeof *delta->pieces);
    for (uint32_t i = 0; i < delta->piece_count; i++)
        if (read_piece(r, &delta->pieces[i], err) != RESULT_OK)
            return fail_in(err, RESULT_FORMAT, "piece %u: ", i);
    return RESULT_OK;
}

enum result mesh_delta_decode(const uint8_t *data, size_t size, size_t *out_used,
                              struct mesh_delta *out_delta, struct error *err) {
    struct reader r = {.data = data, .size = size};
    *out_delta = (struct mesh_delta){0};
    out_delta->base = read_varint(&r);
    out_delta->number = out_delta->base + read_varint(&r) + 1;
    enum result result = read_freed(&r, out_delta, err);
    if (result == RESULT_OK)
        result = read_vertices(&r, out_delta, err);
    if (result == RESULT_OK)
        result = read_made(&r, out_delta, err);
    if (result == RESULT_OK)
        result = read_pieces(&r, out_delta, err);
    out_delta->hash = read_u64(&r);
    if (result == RESULT_OK)
        result = end_check(&r, err);
    if (result == RESULT_OK)
        result = mesh_delta_validate(out_delta, err);
    if (result != RESULT_OK)
        mesh_delta_fini(out_delta);
    *out_used = r.used;
    return result;
}
