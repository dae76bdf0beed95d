#include "base/check.h"
#include "import/repair_steps.h"
#include "mesh/edges.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// A component: triangles connected by shared vertices.
struct piece {
    uint32_t triangles, open_edges;
    double area, volume; // the volume has a meaning where there is no open edge
    struct box box;
    double largest_area;
    vec3 probe; // the middle of its largest triangle
};

struct pieces {
    uint32_t count;
    uint32_t *of_triangle;
    struct piece *all; // by their lowest triangle
};

static void add_piece_triangle(struct piece *piece, const struct mesh *mesh, uint32_t t,
                               vec3 origin) {
    vec3 p[3];
    for (int i = 0; i < 3; i++) {
        p[i] = mesh_corner(mesh, t, i);
        struct box *b = &piece->box;
        b->min = (vec3){fmin(b->min.x, p[i].x), fmin(b->min.y, p[i].y), fmin(b->min.z, p[i].z)};
        b->max = (vec3){fmax(b->max.x, p[i].x), fmax(b->max.y, p[i].y), fmax(b->max.z, p[i].z)};
    }
    vec3 normal = vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0]));
    double area = vec3_length(normal) / 2;
    piece->triangles++;
    piece->area += area;
    piece->volume += vec3_dot(vec3_sub(p[0], origin), normal) / 6;
    if (area > piece->largest_area) {
        piece->largest_area = area;
        piece->probe = vec3_scale(1.0 / 3, vec3_add(p[0], vec3_add(p[1], p[2])));
    }
}

static void count_open_edges(const struct mesh *mesh, struct pieces *pieces) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    struct triangle_side *sides = edges_sorted(mesh);
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        pieces->all[pieces->of_triangle[sides[i].triangle]].open_edges += (end - i) % 2 != 0;
    }
    free(sides);
}

static struct pieces pieces_of(const struct mesh *mesh) {
    struct pieces pieces = {.of_triangle = alloc(mesh->triangle_count, sizeof(uint32_t)),
                            .all = alloc(mesh->triangle_count, sizeof *pieces.all)};
    uint32_t *sets = sets_create(mesh->vertex_count);
    uint32_t *piece_of_set = alloc(mesh->vertex_count, sizeof *piece_of_set);
    memset(piece_of_set, 0xff, mesh->vertex_count * sizeof *piece_of_set);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        sets_join(sets, mesh->triangles[i - i % 3], mesh->triangles[i]);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t *piece = &piece_of_set[sets_find(sets, mesh->triangles[3 * (size_t)t])];
        if (*piece == MESH_NONE) {
            *piece = pieces.count++;
            vec3 corner = mesh_corner(mesh, t, 0);
            pieces.all[*piece] = (struct piece){.box = {corner, corner}, .probe = corner};
        }
        pieces.of_triangle[t] = *piece;
        add_piece_triangle(&pieces.all[*piece], mesh, t, mesh_corner(mesh, 0, 0));
    }
    count_open_edges(mesh, &pieces);
    free(piece_of_set);
    free(sets);
    return pieces;
}

static void pieces_fini(struct pieces *pieces) {
    free(pieces->of_triangle);
    free(pieces->all);
}

// ---- islands ------------------------------------------------------------------------------------

static void report_island(const struct piece *piece, struct repair_report *report) {
    struct repair_island island = {piece->triangles, piece->area,
                                   vec3_scale(0.5, vec3_add(piece->box.min, piece->box.max))};
    for (uint32_t i = 0; i < REPAIR_ISLANDS_MAX && i <= report->island_count; i++) {
        struct repair_island at = report->islands[i];
        if (i < report->island_count && at.area_mm2 >= island.area_mm2)
            continue;
        report->islands[i] = island;
        island = at;
    }
    report->island_count++;
    report->island_triangles += piece->triangles;
    report->island_area_mm2 += piece->area;
}

static uint32_t largest_piece(const struct pieces *pieces) {
    uint32_t largest = 0;
    for (uint32_t i = 1; i < pieces->count; i++)
        if (pieces->all[i].area > pieces->all[largest].area)
            largest = i;
    return largest;
}

void repair_islands(struct mesh *mesh, double share, bool *turned, struct repair_report *report) {
    if (!mesh->triangle_count)
        return;
    struct pieces pieces = pieces_of(mesh);
    uint32_t largest = largest_piece(&pieces);
    bool *island = alloc(pieces.count, sizeof *island);
    bool *kept = alloc(mesh->triangle_count, sizeof *kept);
    for (uint32_t i = 0; i < pieces.count; i++) {
        island[i] = i != largest && pieces.all[i].area < share * report->area_mm2;
        if (island[i])
            report_island(&pieces.all[i], report);
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        kept[t] = !island[pieces.of_triangle[t]];
    repair_keep(mesh, kept, turned);
    free(kept);
    free(island);
    pieces_fini(&pieces);
}

// ---- outwards -----------------------------------------------------------------------------------

// Of a triangle seen from p; van Oosterom and Strackee: tan(Ω/2) = a·(b×c) / (abc + (a·b)c + ...).
static double solid_angle(const struct mesh *mesh, uint32_t t, vec3 p) {
    vec3 a = vec3_sub(mesh_corner(mesh, t, 0), p), b = vec3_sub(mesh_corner(mesh, t, 1), p);
    vec3 c = vec3_sub(mesh_corner(mesh, t, 2), p);
    double la = vec3_length(a), lb = vec3_length(b), lc = vec3_length(c);
    double under = la * lb * lc + vec3_dot(a, b) * lc + vec3_dot(b, c) * la + vec3_dot(c, a) * lb;
    return 2 * atan2(vec3_dot(a, vec3_cross(b, c)), under);
}

static bool is_around(const struct mesh *mesh, const struct pieces *pieces, uint32_t piece,
                      vec3 p) {
    const struct box *box = &pieces->all[piece].box;
    if (p.x < box->min.x || p.y < box->min.y || p.z < box->min.z || p.x > box->max.x ||
        p.y > box->max.y || p.z > box->max.z)
        return false;
    double sum = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        if (pieces->of_triangle[t] == piece)
            sum += solid_angle(mesh, t, p);
    return fabs(sum) > 2 * M_PI;
}

static bool is_void(const struct mesh *mesh, const struct pieces *pieces, uint32_t piece) {
    bool inside = false;
    for (uint32_t i = 0; i < pieces->count; i++)
        if (i != piece && !pieces->all[i].open_edges)
            inside ^= is_around(mesh, pieces, i, pieces->all[piece].probe);
    return inside;
}

static void turn(struct mesh *mesh, uint32_t t, bool *turned) {
    uint32_t *v = mesh->triangles + 3 * (size_t)t, second = v[1];
    v[1] = v[2];
    v[2] = second;
    turned[t] ^= true;
}

void repair_outward(struct mesh *mesh, bool *turned) {
    if (!mesh->triangle_count)
        return;
    struct pieces pieces = pieces_of(mesh);
    bool *turns = alloc(pieces.count, sizeof *turns);
    for (uint32_t i = 0; i < pieces.count; i++)
        if (!pieces.all[i].open_edges)
            turns[i] =
                is_void(mesh, &pieces, i) ? pieces.all[i].volume > 0 : pieces.all[i].volume < 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        if (turns[pieces.of_triangle[t]])
            turn(mesh, t, turned);
    free(turns);
    pieces_fini(&pieces);
}

void repair_voids(const struct mesh *mesh, struct repair_report *report) {
    report->voids = 0;
    if (!mesh->triangle_count)
        return;
    struct pieces pieces = pieces_of(mesh);
    for (uint32_t i = 0; i < pieces.count; i++) {
        if (pieces.all[i].open_edges || !is_void(mesh, &pieces, i))
            continue;
        report->voids++;
        repair_at(report, REPAIR_VOID, pieces.all[i].box.min);
        repair_at(report, REPAIR_VOID, pieces.all[i].box.max);
    }
    pieces_fini(&pieces);
}
