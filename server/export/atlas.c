#include "export/atlas.h"

struct atlas atlas_of(uint32_t triangle_count) {
    struct atlas atlas = {.cells = 1, .triangles = triangle_count};
    while ((uint64_t)atlas.cells * atlas.cells < triangle_count)
        atlas.cells++;
    atlas.width = 2 * atlas.cells;
    atlas.height = 2 * ((triangle_count + atlas.cells - 1) / atlas.cells);
    return atlas;
}

uint32_t atlas_triangle(const struct atlas *atlas, uint32_t x, uint32_t y, int *out_corner) {
    uint32_t triangle = y / 2 * atlas->cells + x / 2;
    *out_corner = (int)(y % 2 * 2 + x % 2);
    return triangle < atlas->triangles ? triangle : UINT32_MAX;
}

void atlas_uv(const struct atlas *atlas, uint32_t triangle, int corner, float out_uv[2]) {
    double x = 2.0 * (triangle % atlas->cells) + (corner == 1);
    double y = 2.0 * (triangle / atlas->cells) + (corner == 2);
    out_uv[0] = (float)((x + 0.5) / atlas->width);
    out_uv[1] = (float)((y + 0.5) / atlas->height);
}
