#include "base/check.h"
#include "import/repair_steps.h"
#include "mesh/edges.h"

#include <stdlib.h>
#include <string.h>

struct triple {
    uint32_t corners[3]; // rising
    uint32_t triangle;
};

static int compare_corners(const struct triple *s, const struct triple *t) {
    for (int i = 0; i < 3; i++)
        if (s->corners[i] != t->corners[i])
            return s->corners[i] < t->corners[i] ? -1 : 1;
    return 0;
}

static int compare_triples(const void *a, const void *b) {
    const struct triple *s = a, *t = b;
    int order = compare_corners(s, t);
    if (order != 0)
        return order;
    return s->triangle < t->triangle ? -1 : s->triangle > t->triangle;
}

static struct triple triple_of(const struct mesh *mesh, uint32_t triangle) {
    struct triple triple = {.triangle = triangle};
    memcpy(triple.corners, mesh->triangles + 3 * (size_t)triangle, sizeof triple.corners);
    uint32_t *c = triple.corners;
    for (int i = 0; i < 3; i++) {
        int k = i % 2; // 0 1, 1 2, 0 1
        if (c[k] > c[k + 1]) {
            uint32_t low = c[k + 1];
            c[k + 1] = c[k];
            c[k] = low;
        }
    }
    return triple;
}

// Keeps the first of those with the same corners; `doubled` where their number was even.
static void keep_first_ones(struct mesh *mesh, bool *doubled, struct repair_report *report) {
    uint32_t count = mesh->triangle_count;
    struct triple *triples = alloc(count, sizeof *triples);
    bool *kept = alloc(count, sizeof *kept);
    for (uint32_t t = 0; t < count; t++)
        triples[t] = triple_of(mesh, t);
    qsort(triples, count, sizeof *triples, compare_triples);
    for (uint32_t i = 0, end; i < count; i = end) {
        for (end = i + 1; end < count && compare_corners(&triples[i], &triples[end]) == 0; end++)
            repair_at_triangle(report, REPAIR_DUPLICATE, mesh, triples[end].triangle);
        kept[triples[i].triangle] = true;
        doubled[triples[i].triangle] = (end - i) % 2 == 0;
    }
    repair_keep(mesh, kept, doubled);
    free(kept);
    free(triples);
}

// ---- walls --------------------------------------------------------------------------------------

// Doubled triangles of one edge belong to one wall. Where other triangles are there too, it tells
// how many edges would be even without the wall, less those that are even with it.
static void weigh_edge(const struct triangle_side *sides, size_t count, const bool *doubled,
                       uint32_t *walls, int32_t *gains) {
    uint32_t first = MESH_NONE;
    size_t of_wall = 0;
    for (size_t i = 0; i < count; i++) {
        if (!doubled[sides[i].triangle])
            continue;
        of_wall++;
        if (first == MESH_NONE)
            first = sides[i].triangle;
        sets_join(walls, sides[i].triangle, first);
    }
    if (of_wall > 0 && of_wall < count)
        gains[first] += (int32_t)(count % 2) - (int32_t)((count - of_wall) % 2);
}

static uint32_t remove_walls(struct mesh *mesh, const bool *doubled, struct repair_report *report) {
    uint32_t before = mesh->triangle_count;
    size_t count = 3 * (size_t)before;
    struct triangle_side *sides = edges_sorted(mesh);
    uint32_t *walls = sets_create(before);
    int32_t *gains = alloc(before, sizeof *gains), *gain_of_wall = alloc(before, sizeof *gains);
    bool *kept = alloc(before, sizeof *kept);
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        weigh_edge(sides + i, end - i, doubled, walls, gains);
    }
    for (uint32_t t = 0; t < before; t++)
        gain_of_wall[sets_find(walls, t)] += gains[t];
    for (uint32_t t = 0; t < before; t++) {
        kept[t] = !doubled[t] || gain_of_wall[sets_find(walls, t)] <= 0;
        if (!kept[t])
            repair_at_triangle(report, REPAIR_WALL, mesh, t);
    }
    repair_keep(mesh, kept, NULL);
    free(kept);
    free(gain_of_wall);
    free(gains);
    free(walls);
    free(sides);
    return before - mesh->triangle_count;
}

void repair_duplicates(struct mesh *mesh, struct repair_report *report) {
    uint32_t before = mesh->triangle_count;
    bool *doubled = alloc(before, sizeof *doubled);
    keep_first_ones(mesh, doubled, report);
    uint32_t walls = remove_walls(mesh, doubled, report);
    report->wall_triangles = 2 * walls;
    report->duplicate_triangles = before - mesh->triangle_count - 2 * walls;
    free(doubled);
}
