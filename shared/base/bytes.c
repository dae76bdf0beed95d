#include "base/bytes.h"

#include <string.h>

static uint8_t *room_for(struct writer *w, size_t size) {
    if (w->overflow || w->size - w->used < size) {
        w->overflow = true;
        return NULL;
    }
    uint8_t *at = w->data + w->used;
    w->used += size;
    return at;
}

static void write_little_endian(struct writer *w, uint64_t value, size_t size) {
    uint8_t *at = room_for(w, size);
    for (size_t i = 0; at && i < size; i++)
        at[i] = (uint8_t)(value >> (8 * i));
}

void write_u8(struct writer *w, uint8_t value) {
    write_little_endian(w, value, 1);
}

void write_u16(struct writer *w, uint16_t value) {
    write_little_endian(w, value, 2);
}

void write_u32(struct writer *w, uint32_t value) {
    write_little_endian(w, value, 4);
}

void write_u64(struct writer *w, uint64_t value) {
    write_little_endian(w, value, 8);
}

void write_i64(struct writer *w, int64_t value) {
    write_u64(w, (uint64_t)value);
}

void write_f64(struct writer *w, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    write_u64(w, bits);
}

void write_vec3(struct writer *w, vec3 v) {
    write_f64(w, v.x);
    write_f64(w, v.y);
    write_f64(w, v.z);
}

void write_pose(struct writer *w, pose p) {
    write_f64(w, p.rotation.w);
    write_vec3(w, (vec3){p.rotation.x, p.rotation.y, p.rotation.z});
    write_vec3(w, p.translation);
}

void write_bytes(struct writer *w, const void *bytes, size_t size) {
    uint8_t *at = room_for(w, size);
    if (at && size)
        memcpy(at, bytes, size);
}

void write_text(struct writer *w, const char *text) {
    size_t length = strnlen(text, UINT16_MAX);
    write_u16(w, (uint16_t)length);
    write_bytes(w, text, length);
}

const uint8_t *read_bytes(struct reader *r, size_t size) {
    if (r->underflow || r->size - r->used < size) {
        r->underflow = true;
        return NULL;
    }
    const uint8_t *at = r->data + r->used;
    r->used += size;
    return at;
}

static uint64_t read_little_endian(struct reader *r, size_t size) {
    const uint8_t *at = read_bytes(r, size);
    uint64_t value = 0;
    for (size_t i = 0; at && i < size; i++)
        value |= (uint64_t)at[i] << (8 * i);
    return value;
}

uint8_t read_u8(struct reader *r) {
    return (uint8_t)read_little_endian(r, 1);
}

uint16_t read_u16(struct reader *r) {
    return (uint16_t)read_little_endian(r, 2);
}

uint32_t read_u32(struct reader *r) {
    return (uint32_t)read_little_endian(r, 4);
}

uint64_t read_u64(struct reader *r) {
    return read_little_endian(r, 8);
}

int64_t read_i64(struct reader *r) {
    return (int64_t)read_u64(r);
}

double read_f64(struct reader *r) {
    uint64_t bits = read_u64(r);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

vec3 read_vec3(struct reader *r) {
    double x = read_f64(r), y = read_f64(r);
    return (vec3){x, y, read_f64(r)};
}

pose read_pose(struct reader *r) {
    double w = read_f64(r);
    vec3 v = read_vec3(r);
    return (pose){{w, v.x, v.y, v.z}, read_vec3(r)};
}

void read_text(struct reader *r, char *out_text, size_t out_size) {
    size_t length = read_u16(r);
    if (length >= out_size)
        r->underflow = true;
    const uint8_t *at = read_bytes(r, length);
    if (at)
        memcpy(out_text, at, length);
    out_text[at ? length : 0] = '\0';
}
