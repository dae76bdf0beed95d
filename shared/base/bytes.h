// Little-endian fields written to and read from a buffer of the caller's, with bounds: the layout
// of every binary file of ours is a sequence of these calls.
#pragma once

#include "base/pose.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct writer {
    uint8_t *data;
    size_t size, used;
    bool overflow; // set once something did not fit; nothing is written from then on
};

void write_u8(struct writer *writer, uint8_t value);
void write_u16(struct writer *writer, uint16_t value);
void write_u32(struct writer *writer, uint32_t value);
void write_u64(struct writer *writer, uint64_t value);
void write_i64(struct writer *writer, int64_t value);
void write_f64(struct writer *writer, double value); // bit for bit, NaN too
void write_vec3(struct writer *writer, vec3 v);
void write_pose(struct writer *writer, pose p); // rotation w, x, y, z, then translation
void write_bytes(struct writer *writer, const void *bytes, size_t size);
void write_text(struct writer *writer, const char *text); // u16 length, bytes

struct reader {
    const uint8_t *data;
    size_t size, used;
    bool underflow; // set once something was missing; 0 is read from then on
};

uint8_t read_u8(struct reader *reader);
uint16_t read_u16(struct reader *reader);
uint32_t read_u32(struct reader *reader);
uint64_t read_u64(struct reader *reader);
int64_t read_i64(struct reader *reader);
double read_f64(struct reader *reader);
vec3 read_vec3(struct reader *reader);
pose read_pose(struct reader *reader);
const uint8_t *read_bytes(struct reader *reader, size_t size);          // NULL where missing
void read_text(struct reader *reader, char *out_text, size_t out_size); // too long: underflow
