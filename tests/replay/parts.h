// The parts of an OpenEXR file in memory, for tests and benches.
#pragma once

#include "base/result.h"

#include <stdint.h>

struct exr_channel {
    char name[256];
    int is_float;
    uint32_t *values; // width * height, bits of a float or a number
};

struct exr_part {
    char name[256];
    uint32_t width, height;
    int channel_count;
    struct exr_channel *channels;
};

struct exr_parts {
    int count;
    struct exr_part *parts;
};

enum result exr_parts_read(const char *path, struct exr_parts *out_parts, struct error *err);
void exr_parts_fini(struct exr_parts *parts);
const struct exr_part *exr_part(const struct exr_parts *parts, const char *name); // or NULL
// The values of "name" and "ending" together; NULL where there is no such channel.
const uint32_t *exr_values(const struct exr_part *part, const char *name, const char *ending);
