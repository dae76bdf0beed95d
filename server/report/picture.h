// A picture in memory, and as PNG (libpng behind this header).
#pragma once

#include "base/result.h"

#include <stdint.h>

#define PICTURE_SIDE_MAX 8192

struct picture {
    int width, height;
    uint8_t *rgb; // 3 * width * height, sRGB, rows from the top
};

// Black. Sides from 1 to PICTURE_SIDE_MAX. The caller releases it with picture_fini.
void picture_init(struct picture *picture, int width, int height);
void picture_fini(struct picture *picture); // a zeroed picture is fine; it is zeroed

// The bytes of a PNG file: the same for the same picture. The caller frees *out_bytes.
enum result picture_encode(const struct picture *picture, uint8_t **out_bytes, size_t *out_size,
                           struct error *err);

// Replaces a file that is there; after a failure it may be incomplete. The error names the path.
enum result picture_write(const struct picture *picture, const char *path, struct error *err);
