#include "mesh/edges.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

// A counting sort by the lower or the higher vertex. Sides of equal ones stay as they were.
static void sort_sides(const struct triangle_side *sides, size_t count, bool by_low, size_t *starts,
                       uint32_t vertex_count, struct triangle_side *out) {
    memset(starts, 0, ((size_t)vertex_count + 1) * sizeof *starts);
    for (size_t i = 0; i < count; i++)
        starts[(by_low ? sides[i].low : sides[i].high) + 1]++;
    for (uint32_t v = 0; v < vertex_count; v++)
        starts[v + 1] += starts[v];
    for (size_t i = 0; i < count; i++)
        out[starts[by_low ? sides[i].low : sides[i].high]++] = sides[i];
}

struct triangle_side *edges_sorted(const struct mesh *mesh) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    struct triangle_side *sides = alloc(count, sizeof *sides);
    for (size_t i = 0; i < count; i++) {
        uint32_t from = mesh->triangles[i];
        uint32_t to = mesh->triangles[i - i % 3 + (i + 1) % 3];
        sides[i] = from < to ? (struct triangle_side){from, to, (uint32_t)(i / 3), true}
                             : (struct triangle_side){to, from, (uint32_t)(i / 3), false};
    }
    struct triangle_side *by_high = alloc(count, sizeof *by_high);
    size_t *starts = alloc((size_t)mesh->vertex_count + 1, sizeof *starts);
    sort_sides(sides, count, false, starts, mesh->vertex_count, by_high);
    sort_sides(by_high, count, true, starts, mesh->vertex_count, sides);
    free(by_high);
    free(starts);
    return sides;
}

uint32_t *sets_create(uint32_t count) {
    uint32_t *sets = alloc(count, sizeof *sets);
    for (uint32_t i = 0; i < count; i++)
        sets[i] = i;
    return sets;
}

// By path halving.
uint32_t sets_find(uint32_t *sets, uint32_t i) {
    while (sets[i] != i)
        i = sets[i] = sets[sets[i]];
    return i;
}

void sets_join(uint32_t *sets, uint32_t a, uint32_t b) {
    sets[sets_find(sets, a)] = sets_find(sets, b);
}

size_t edges_end(const struct triangle_side *sides, size_t start, size_t count) {
    size_t end = start + 1;
    while (end < count && sides[end].low == sides[start].low &&
           sides[end].high == sides[start].high)
        end++;
    return end;
}

bool *edges_open_vertices(const struct mesh *mesh) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    bool *open = alloc(mesh->vertex_count, sizeof *open);
    struct triangle_side *sides = edges_sorted(mesh);
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        if (end - i == 1)
            open[sides[i].low] = open[sides[i].high] = true;
    }
    free(sides);
    return open;
}

static uint32_t corner_of(const struct mesh *mesh, uint32_t triangle, uint32_t vertex) {
    uint32_t corner = 3 * triangle;
    while (mesh->triangles[corner] != vertex)
        corner++;
    return corner;
}

void edges_join_fans(const struct mesh *mesh, uint32_t *fans, const struct triangle_side *a,
                     const struct triangle_side *b) {
    sets_join(fans, corner_of(mesh, a->triangle, a->low), corner_of(mesh, b->triangle, a->low));
    sets_join(fans, corner_of(mesh, a->triangle, a->high), corner_of(mesh, b->triangle, a->high));
}
