#include "cut/polygon.h"
#include "cut/stage.h"

static void add_triangles(struct stage *stage, uint32_t label, const uint32_t *corners,
                          uint32_t count) {
    stage->made =
        array_grow(stage->made, &stage->made_room, stage->made_count + count, sizeof *stage->made);
    for (const uint32_t *c = corners; c < corners + 3 * (size_t)count; c += 3)
        stage->made[stage->made_count++] = (struct new_triangle){{c[0], c[1], c[2]}, label};
}

// Rings of two vertices are slits: both sides are borders of others, which will find each other.
static bool fill_region(const struct cut_mesh *mesh, struct stage *stage, uint32_t index) {
    const struct region *region = &stage->regions[index];
    const struct vertex_ring *rings = stage->rings + region->first_ring;
    const uint32_t *vertices = stage->ring_vertices.at, *corners;
    uint32_t count;
    if (rings[0].count < 3)
        return true;
    if (region->ring_count == 1 && rings[0].count == 3) {
        add_triangles(stage, region->label, vertices + rings[0].first, 1);
        return true;
    }
    polygon_begin(stage->filler, &stage->drawn, region->normal,
                  mesh->points[vertices[rings[0].first]]);
    for (uint32_t r = 0; r < region->ring_count; r++)
        if (rings[r].count >= 3)
            polygon_add_ring(stage->filler, mesh->points, vertices + rings[r].first,
                             rings[r].count);
    const char *refusal = polygon_fill(stage->filler, &corners, &count);
    if (refusal)
        return stage_refuse(stage, refusal);
    add_triangles(stage, region->label, corners, count);
    return true;
}

bool fill_regions(const struct cut_mesh *mesh, struct stage *stage) {
    sides_clear(&stage->drawn, 2 * stage->ring_vertices.count + 4 * stage->ring_count);
    for (uint32_t r = 0; r < stage->ring_count; r++)
        polygon_draw_ring(&stage->drawn, stage->ring_vertices.at + stage->rings[r].first,
                          stage->rings[r].count);
    for (uint32_t i = 0; i < stage->region_count; i++)
        if (!fill_region(mesh, stage, i))
            return false;
    return true;
}
