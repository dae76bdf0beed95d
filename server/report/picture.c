#include "report/picture.h"

#include "base/check.h"
#include "base/draft.h"

#include <png.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void picture_init(struct picture *picture, int width, int height) {
    CHECK(width > 0 && width <= PICTURE_SIDE_MAX && height > 0 && height <= PICTURE_SIDE_MAX);
    *picture = (struct picture){width, height, alloc(3 * (size_t)width * (size_t)height, 1)};
}

void picture_fini(struct picture *picture) {
    free(picture->rgb);
    *picture = (struct picture){0};
}

enum result picture_encode(const struct picture *picture, uint8_t **out_bytes, size_t *out_size,
                           struct error *err) {
    png_image image = {
        .version = PNG_IMAGE_VERSION,
        .width = (png_uint_32)picture->width,
        .height = (png_uint_32)picture->height,
        .format = PNG_FORMAT_RGB,
    };
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    uint8_t *bytes = alloc(size, 1);
    if (!png_image_write_to_memory(&image, bytes, &size, 0, picture->rgb, 0, NULL)) {
        free(bytes);
        return fail(err, RESULT_IO, "libpng: %s", image.message);
    }
    *out_bytes = bytes;
    *out_size = size;
    return RESULT_OK;
}

enum result picture_write(const struct picture *picture, const char *path, struct error *err) {
    uint8_t *bytes = NULL;
    size_t size = 0;
    enum result result = picture_encode(picture, &bytes, &size, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "%s: ", path);
    result = draft_write(path, bytes, size, err);
    free(bytes);
    return result;
}
