// Images of many channels as an OpenEXR file, written row by row (OpenEXRCore behind this header).
// A file has parts, each an image with its own size and channels; rows and parts are given in
// order. Compressed without loss (ZIPS).
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define IMAGE_NAME_MAX 64
#define IMAGE_SIDE_MAX (1 << 24)

enum image_type { IMAGE_FLOAT, IMAGE_UINT };

struct image_channel {
    char name[IMAGE_NAME_MAX]; // no two alike in a part
    enum image_type type;
};

static inline uint32_t image_float(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline uint64_t image_bits(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline void image_split(uint64_t bits, uint32_t *out_low, uint32_t *out_high) {
    *out_low = (uint32_t)bits;
    *out_high = (uint32_t)(bits >> 32);
}

struct image_writer;

// The first thing that fails is kept, and all later calls do nothing: image_writer_finish says what
// it was.
struct image_writer *image_writer_create(const char *path);

bool image_writer_is_good(const struct image_writer *writer); // nothing has failed yet

// The number of the part. Sides from 1 to IMAGE_SIDE_MAX. The channels are copied.
int image_writer_part(struct image_writer *writer, const char *name, uint32_t width,
                      uint32_t height, const struct image_channel *channels, int channel_count);
void image_writer_text(struct image_writer *writer, int part, const char *name, const char *text);
void image_writer_number(struct image_writer *writer, int part, const char *name, double number);

// The next row: for each channel, in the order they were given, `width` values of 32 bits. All
// parts and attributes come before the first row.
void image_writer_row(struct image_writer *writer, const uint32_t *values);

// After the last row of the last part. The file takes its place complete, or there is none. *writer
// becomes NULL. The error names the path.
enum result image_writer_finish(struct image_writer **writer, struct error *err);
void image_writer_abandon(struct image_writer **writer); // before all rows were given: no file
