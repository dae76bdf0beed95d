#include "generate/refine.h"

#include "base/check.h"
#include "mesh/edges.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ROUNDS_MAX 12
#define INRADIUS_SHARE 0.3 // of a side, at most: how far a triangle's inside is from its sides

// New vertices in the order of their edges' lower ends, so that those of a part follow each other.
struct halves {
    uint32_t count;
    uint32_t (*ends)[2];
    uint32_t *of_side; // 3 * triangle_count: from corner i to the next; MESH_NONE: stays whole
};

static vec3 displaced(const struct case_group *group, uint32_t v) {
    vec3 p = mesh_vertex(&group->mesh, v);
    const float *w = group->warp ? group->warp + 3 * (size_t)v : NULL;
    return w ? vec3_add(p, (vec3){(double)w[0], (double)w[1], (double)w[2]}) : p;
}

static double distance_to_line(vec3 p, vec3 a, vec3 b) {
    vec3 along = vec3_sub(b, a);
    double square = vec3_dot(along, along);
    double t = square > 0 ? vec3_dot(vec3_sub(p, a), along) / square : 0;
    return vec3_distance(p, vec3_add_scaled(a, fmin(fmax(t, 0), 1), along));
}

static bool is_coarse(const struct refine_map *map, vec3 a, vec3 b) {
    double length = vec3_distance(a, b), off = distance_to_line(map->middle, a, b);
    if (length > map->radius_mm / 2 && off < map->radius_mm + INRADIUS_SHARE * length)
        return true;
    if (off >= map->radius_mm)
        return false;
    vec3 mean =
        vec3_lerp(map->displacement(map->context, a), map->displacement(map->context, b), 0.5);
    return vec3_distance(map->displacement(map->context, vec3_lerp(a, b, 0.5)), mean) > REFINE_MM;
}

static struct halves find_halves(const struct case_group *group, const struct refine_map *map) {
    const struct mesh *mesh = &group->mesh;
    size_t count = 3 * (size_t)mesh->triangle_count, end;
    struct triangle_side *sides = edges_sorted(mesh);
    struct halves halves = {.ends = alloc(count, sizeof *halves.ends),
                            .of_side = alloc(count, sizeof *halves.of_side)};
    memset(halves.of_side, 0xff, count * sizeof *halves.of_side);
    for (size_t i = 0; i < count; i = end) {
        end = edges_end(sides, i, count);
        uint32_t low = sides[i].low, high = sides[i].high;
        if (!is_coarse(map, displaced(group, low), displaced(group, high)))
            continue;
        halves.ends[halves.count][0] = low;
        halves.ends[halves.count][1] = high;
        for (size_t k = i; k < end; k++) {
            const uint32_t *v = mesh->triangles + 3 * (size_t)sides[k].triangle;
            uint32_t from = sides[k].forward ? low : high, corner = 0;
            while (v[corner] != from)
                corner++;
            halves.of_side[3 * (size_t)sides[k].triangle + corner] = halves.count;
        }
        halves.count++;
    }
    free(sides);
    return halves;
}

// ---- vertices -----------------------------------------------------------------------------------

static uint32_t new_before(const struct halves *halves, uint32_t vertex) {
    uint32_t low = 0, high = halves->count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (halves->ends[middle][0] < vertex)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

// Values of each vertex, `width` of them, with those of the new ones behind those of their part.
static float *with_halves(const struct case_group *group, const struct halves *halves,
                          float *values, size_t width) {
    if (!values)
        return NULL;
    float *all = alloc((group->mesh.vertex_count + (size_t)halves->count) * width, sizeof *all);
    float *to = all;
    for (int i = 0; i < group->part_count; i++) {
        const struct case_part *part = &group->parts[i];
        uint32_t end = part->first_vertex + part->vertex_count;
        memcpy(to, values + width * part->first_vertex, width * part->vertex_count * sizeof *to);
        to += width * part->vertex_count;
        for (uint32_t h = new_before(halves, part->first_vertex); h < new_before(halves, end); h++)
            for (size_t k = 0; k < width; k++)
                *to++ = (values[width * halves->ends[h][0] + k] +
                         values[width * halves->ends[h][1] + k]) /
                        2;
    }
    free(values);
    return all;
}

// ---- triangles ----------------------------------------------------------------------------------

static uint32_t *put(uint32_t *to, uint32_t a, uint32_t b, uint32_t c) {
    to[0] = a;
    to[1] = b;
    to[2] = c;
    return to + 3;
}

// v: the corners; h: the vertices in the middle of the sides from each corner to the next.
static uint32_t *put_parts(uint32_t *to, const uint32_t v[3], const uint32_t h[3]) {
    int count = (h[0] != MESH_NONE) + (h[1] != MESH_NONE) + (h[2] != MESH_NONE);
    int first = 0; // so that side `first` is halved, and the one before it last
    while (count > 0 && count < 3 && !(h[first] != MESH_NONE && h[(first + 2) % 3] == MESH_NONE))
        first++;
    uint32_t a = v[first], b = v[(first + 1) % 3], c = v[(first + 2) % 3];
    uint32_t ab = h[first], bc = h[(first + 1) % 3], ca = h[(first + 2) % 3];
    if (count == 0)
        return put(to, a, b, c);
    if (count == 1)
        return put(put(to, a, ab, c), ab, b, c);
    to = put(to, b, bc, ab);
    if (count == 2)
        return put(put(to, a, ab, bc), a, bc, c);
    return put(put(put(to, a, ab, ca), c, ca, bc), ab, bc, ca);
}

static void halve(struct case_group *group, const struct halves *halves) {
    const struct mesh *mesh = &group->mesh;
    uint32_t *triangles = alloc(12 * (size_t)mesh->triangle_count, sizeof *triangles);
    uint32_t *to = triangles;
    for (int i = 0; i < group->part_count; i++) {
        struct case_part *part = &group->parts[i];
        uint32_t before = new_before(halves, part->first_vertex);
        uint32_t end = part->first_vertex + part->vertex_count;
        uint32_t *first = to;
        for (uint32_t t = 0; t < part->triangle_count; t++) {
            size_t slot = 3 * ((size_t)part->first_triangle + t);
            uint32_t v[3], h[3];
            for (size_t k = 0; k < 3; k++) {
                v[k] = mesh->triangles[slot + k] + before;
                h[k] = halves->of_side[slot + k];
                h[k] = h[k] == MESH_NONE ? MESH_NONE : end + h[k];
            }
            to = put_parts(to, v, h);
        }
        part->first_triangle = (uint32_t)((first - triangles) / 3);
        part->triangle_count = (uint32_t)((to - first) / 3);
    }
    free(group->mesh.triangles);
    group->mesh.triangles = triangles;
    group->mesh.triangle_count = (uint32_t)((to - triangles) / 3);
}

static void move_parts(struct case_group *group, const struct halves *halves) {
    for (int i = 0; i < group->part_count; i++) {
        struct case_part *part = &group->parts[i];
        uint32_t before = new_before(halves, part->first_vertex);
        uint32_t after = new_before(halves, part->first_vertex + part->vertex_count);
        part->first_vertex += before;
        part->vertex_count += after - before;
    }
}

static void take(struct case_group *group, const struct halves *halves) {
    halve(group, halves);
    group->mesh.positions = with_halves(group, halves, group->mesh.positions, 3);
    group->warp = with_halves(group, halves, group->warp, 3);
    group->maxcut = with_halves(group, halves, group->maxcut, 3);
    group->other_share = with_halves(group, halves, group->other_share, 1);
    group->covered = with_halves(group, halves, group->covered, 1);
    group->wear = with_halves(group, halves, group->wear, 1);
    group->mesh.vertex_count += halves->count;
    move_parts(group, halves);
    for (uint32_t v = 0; group->covered && v < group->mesh.vertex_count; v++)
        group->covered[v] = floorf(group->covered[v]);
}

void refine_group(struct case_group *group, const struct refine_map *map) {
    for (int round = 0; round < ROUNDS_MAX; round++) {
        struct halves halves = find_halves(group, map);
        if (halves.count)
            take(group, &halves);
        bool done = !halves.count;
        free(halves.ends);
        free(halves.of_side);
        if (done)
            return;
    }
}
