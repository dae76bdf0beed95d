#include "step/touch.h"

#include "base/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

// A vertex: the difference of its index to the one before, less 1, and three offsets with their
// signs in the lowest bits. Each number has seven bits in a byte, the lowest first; the highest bit
// says that more follow.
#define NUMBER_BYTES_MAX 5
#define VERTEX_BYTES_MAX (4 * NUMBER_BYTES_MAX)
#define VERTEX_BYTES_MIN 4
#define FARTHEST (TOUCH_FARTHEST_MM * (int64_t)TOUCH_PER_MM)

void touch_change_make_room(struct touch_change *touch, int width, uint32_t count) {
    touch->width = width;
    touch->vertices = alloc(count, sizeof *touch->vertices);
    touch->values = alloc((size_t)width * count, sizeof *touch->values);
}

void touch_change_fini(struct touch_change *touch) {
    free(touch->vertices);
    free(touch->values);
    free(touch->bytes);
    *touch = (struct touch_change){0};
}

// ---- bytes --------------------------------------------------------------------------------------

static size_t put_number(uint8_t *out, uint32_t number) {
    size_t size = 0;
    for (; number >= 0x80; number >>= 7)
        out[size++] = (uint8_t)(number | 0x80);
    out[size++] = (uint8_t)number;
    return size;
}

// False beyond the limits.
static bool put_vertex(struct touch_change *touch, uint32_t since, const double *offset) {
    if (touch->size > TOUCH_BYTES_MAX - VERTEX_BYTES_MAX)
        return false;
    touch->size += put_number(touch->bytes + touch->size, since);
    for (int k = 0; k < 3; k++) {
        if (!(fabs(offset[k]) <= TOUCH_FARTHEST_MM))
            return false;
        int64_t units = (int64_t)(offset[k] * TOUCH_PER_MM);
        uint64_t number = units < 0 ? 2 * (uint64_t)-units - 1 : 2 * (uint64_t)units;
        touch->size += put_number(touch->bytes + touch->size, (uint32_t)number);
    }
    return true;
}

void touch_encode(struct touch_change *touch) {
    size_t room = VERTEX_BYTES_MAX * (size_t)touch->count;
    uint32_t next = 0;
    CHECK(touch->width == 3);
    free(touch->bytes);
    touch->bytes = alloc(room < TOUCH_BYTES_MAX ? room : TOUCH_BYTES_MAX, 1);
    touch->size = 0;
    for (uint32_t i = 0; i < touch->count; i++) {
        uint32_t vertex = touch->vertices[i];
        if (!put_vertex(touch, vertex - next, touch->values + 3 * (size_t)i)) {
            touch->size = 0;
            return;
        }
        next = vertex + 1;
    }
}

struct cursor {
    const uint8_t *at, *end;
};

// A number has no leading zeros: so the same offsets have the same bytes.
static bool take_number(struct cursor *c, uint32_t *out) {
    uint64_t number = 0;
    for (int i = 0; i < NUMBER_BYTES_MAX && c->at < c->end; i++) {
        uint8_t byte = *c->at++;
        number |= (uint64_t)(byte & 0x7f) << (7 * i);
        if (byte & 0x80)
            continue;
        *out = (uint32_t)number;
        return number <= UINT32_MAX && (byte || !i);
    }
    return false;
}

static bool take_vertex(struct cursor *c, uint32_t *in_out_next, double out_offset[3],
                        uint32_t *out_vertex) {
    uint32_t since, number;
    if (!take_number(c, &since) || since >= INT32_MAX - *in_out_next)
        return false;
    *out_vertex = *in_out_next + since;
    *in_out_next = *out_vertex + 1;
    for (int k = 0; k < 3; k++) {
        if (!take_number(c, &number))
            return false;
        int64_t units = number & 1 ? -(int64_t)(number / 2) - 1 : (int64_t)(number / 2);
        if (units < -FARTHEST || units > FARTHEST)
            return false;
        out_offset[k] = (double)units / TOUCH_PER_MM;
    }
    return true;
}

bool touch_decode(const uint8_t *bytes, size_t size, struct touch_change *out) {
    struct cursor c = {bytes, bytes + size};
    uint32_t next = 0;
    *out = (struct touch_change){.size = size};
    touch_change_make_room(out, 3, (uint32_t)(size / VERTEX_BYTES_MIN) + 1);
    out->bytes = alloc(size, 1);
    memcpy(out->bytes, bytes, size);
    while (c.at < c.end) {
        if (!take_vertex(&c, &next, out->values + 3 * (size_t)out->count,
                         &out->vertices[out->count]))
            return false;
        out->count++;
    }
    return true;
}

uint64_t touch_hash(const struct touch_change *touch) {
    return touch->size ? XXH3_64bits(touch->bytes, touch->size) : 0;
}
