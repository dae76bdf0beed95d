#include "base/check.h"
#include "import/repair_steps.h"
#include "mesh/edges.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AROUND_MAX 64 // triangles at one edge
#define SAME_ANGLE 1e-9

// ---- which triangles run the same way round: disjoint sets with a parity ------------------------

struct ways {
    uint32_t *parent;
    bool *against; // a triangle runs against its parent
};

static uint32_t way_of(const struct ways *ways, uint32_t triangle, bool *out_against) {
    bool against = false;
    while (ways->parent[triangle] != triangle) {
        uint32_t up = ways->parent[triangle];
        ways->against[triangle] ^= ways->against[up]; // that of a root is false
        ways->parent[triangle] = ways->parent[up];
        against ^= ways->against[triangle];
        triangle = ways->parent[triangle];
    }
    *out_against = against;
    return triangle;
}

// What contradicts earlier links is left: a surface with one side only.
static void link_ways(struct ways *ways, uint32_t a, uint32_t b, bool against) {
    bool a_against, b_against;
    uint32_t a_root = way_of(ways, a, &a_against), b_root = way_of(ways, b, &b_against);
    if (a_root == b_root)
        return;
    ways->parent[b_root] = a_root;
    ways->against[b_root] = a_against ^ b_against ^ against;
}

// ---- around an edge -----------------------------------------------------------------------------

struct around {
    double angle; // about the edge, from low to high
    const struct triangle_side *side;
};

static int compare_around(const void *a, const void *b) {
    double s = ((const struct around *)a)->angle, t = ((const struct around *)b)->angle;
    return s < t ? -1 : s > t;
}

static vec3 apex_of(const struct mesh *mesh, const struct triangle_side *side) {
    const uint32_t *v = mesh->triangles + 3 * (size_t)side->triangle;
    for (int i = 0; i < 2; i++)
        if (v[i] != side->low && v[i] != side->high)
            return mesh_vertex(mesh, v[i]);
    return mesh_vertex(mesh, v[2]);
}

// The sides of one edge in the order in which they lie around it. False where that is not known:
// their number is odd, or two lie on one another.
static bool sort_around(const struct mesh *mesh, const struct triangle_side *sides, size_t count,
                        struct around *out) {
    if (count % 2 != 0 || count > AROUND_MAX)
        return false;
    vec3 low = mesh_vertex(mesh, sides[0].low), along = mesh_vertex(mesh, sides[0].high);
    along = vec3_unit_or(vec3_sub(along, low), (vec3){0});
    vec3 first = vec3_sub(apex_of(mesh, &sides[0]), low), across = vec3_cross(along, first);
    for (size_t i = 0; i < count; i++) {
        vec3 apex = vec3_sub(apex_of(mesh, &sides[i]), low);
        vec3 out_of = vec3_cross(along, apex);
        double angle = atan2(vec3_dot(vec3_cross(across, out_of), along), vec3_dot(across, out_of));
        out[i] = (struct around){angle, &sides[i]};
        if (!(vec3_length(out_of) > 0))
            return false;
    }
    qsort(out, count, sizeof *out, compare_around);
    for (size_t i = 1; i < count; i++)
        if (out[i].angle - out[i - 1].angle < SAME_ANGLE)
            return false;
    return out[0].angle + 2 * M_PI - out[count - 1].angle >= SAME_ANGLE;
}

// ---- turning ------------------------------------------------------------------------------------

static struct ways find_ways(const struct mesh *mesh, const struct triangle_side *sides) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    struct ways ways = {sets_create(mesh->triangle_count),
                        alloc(mesh->triangle_count, sizeof *ways.against)};
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        if (end - i == 2)
            link_ways(&ways, sides[i].triangle, sides[i + 1].triangle,
                      sides[i].forward == sides[i + 1].forward);
    }
    struct around around[AROUND_MAX];
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        if (end - i == 2 || !sort_around(mesh, sides + i, end - i, around))
            continue;
        for (size_t k = 1; k < end - i; k++)
            link_ways(&ways, around[k - 1].side->triangle, around[k].side->triangle,
                      around[k - 1].side->forward == around[k].side->forward);
    }
    return ways;
}

// For each set of linked triangles: six times the volume that its first one's way encloses, whether
// it is closed, and how many triangles run each way.
struct way_sums {
    double volume;
    uint32_t count[2];
    bool open;
};

static void sum_ways(const struct mesh *mesh, const struct triangle_side *sides,
                     const struct ways *ways, struct way_sums *sums) {
    bool against;
    vec3 origin = mesh_corner(mesh, 0, 0);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        struct way_sums *sum = &sums[way_of(ways, t, &against)];
        vec3 a = vec3_sub(mesh_corner(mesh, t, 0), origin);
        vec3 b = vec3_sub(mesh_corner(mesh, t, 1), origin);
        vec3 c = vec3_sub(mesh_corner(mesh, t, 2), origin);
        double volume = vec3_dot(a, vec3_cross(b, c));
        sum->volume += against ? -volume : volume;
        sum->count[against]++;
    }
    size_t count = 3 * (size_t)mesh->triangle_count;
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        for (size_t k = i; k < end && (end - i) % 2 != 0; k++)
            sums[way_of(ways, sides[k].triangle, &against)].open = true;
    }
}

// Closed sets outwards; of open ones the smaller part follows the larger.
static void turn_ways(struct mesh *mesh, const struct triangle_side *sides, bool *turned) {
    struct ways ways = find_ways(mesh, sides);
    struct way_sums *sums = alloc(mesh->triangle_count, sizeof *sums);
    sum_ways(mesh, sides, &ways, sums);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        bool against;
        const struct way_sums *sum = &sums[way_of(&ways, t, &against)];
        bool root_turns = sum->open ? sum->count[1] > sum->count[0] : sum->volume < 0;
        turned[t] = against ^ root_turns;
        uint32_t *v = mesh->triangles + 3 * (size_t)t, second = v[1];
        if (turned[t]) {
            v[1] = v[2];
            v[2] = second;
        }
    }
    free(sums);
    free(ways.parent);
    free(ways.against);
}

// ---- splitting ----------------------------------------------------------------------------------

// A triangle that runs from low to high faces the rising angle: its solid lies before it.
static bool alternates(const struct around *around, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (around[i].side->forward == around[(i + 1) % count].side->forward)
            return false;
    return true;
}

static void join_at_edge(const struct mesh *mesh, const struct triangle_side *sides, size_t count,
                         uint32_t *fans) {
    struct around around[AROUND_MAX];
    if (count > 2 && sort_around(mesh, sides, count, around) && alternates(around, count)) {
        for (size_t i = 0; i < count; i++)
            if (around[i].side->forward)
                edges_join_fans(mesh, fans, around[i].side, around[(i + count - 1) % count].side);
        return;
    }
    for (size_t i = 1; i < count; i++)
        edges_join_fans(mesh, fans, &sides[0], &sides[i]);
}

static uint32_t *find_fans(const struct mesh *mesh) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    uint32_t *fans = sets_create(3 * mesh->triangle_count);
    struct triangle_side *sides = edges_sorted(mesh);
    for (size_t i = 0, end; i < count; i = end) {
        end = edges_end(sides, i, count);
        join_at_edge(mesh, sides + i, end - i, fans);
    }
    free(sides);
    return fans;
}

// The first fan of a vertex keeps it, every other one gets a copy.
static uint32_t split_vertices(struct mesh *mesh, struct repair_report *report) {
    uint32_t corners = 3 * mesh->triangle_count, count = mesh->vertex_count;
    uint32_t *fans = find_fans(mesh);
    uint32_t *vertex_of_fan = alloc(corners, sizeof *vertex_of_fan);
    uint32_t *source = alloc((size_t)count + corners, sizeof *source);
    bool *taken = alloc(count, sizeof *taken);
    memset(vertex_of_fan, 0xff, corners * sizeof *vertex_of_fan);
    for (uint32_t corner = 0; corner < corners; corner++) {
        uint32_t fan = sets_find(fans, corner), vertex = mesh->triangles[corner];
        if (vertex_of_fan[fan] == MESH_NONE) {
            if (taken[vertex])
                repair_at(report, REPAIR_SPLIT, mesh_vertex(mesh, vertex));
            vertex_of_fan[fan] = taken[vertex] ? count++ : vertex;
            source[vertex_of_fan[fan]] = vertex;
            taken[vertex] = true;
        }
        mesh->triangles[corner] = vertex_of_fan[fan];
    }
    uint32_t copies = count - mesh->vertex_count;
    mesh->positions = alloc_resize(mesh->positions, 3 * (size_t)count, sizeof *mesh->positions);
    for (uint32_t v = mesh->vertex_count; v < count; v++)
        memcpy(mesh->positions + 3 * (size_t)v, mesh->positions + 3 * (size_t)source[v],
               3 * sizeof *mesh->positions);
    mesh->vertex_count = count;
    free(taken);
    free(source);
    free(vertex_of_fan);
    free(fans);
    return copies;
}

void repair_sheets(struct mesh *mesh, bool *turned, struct repair_report *report) {
    struct triangle_side *sides = edges_sorted(mesh);
    turn_ways(mesh, sides, turned);
    free(sides);
    report->split_vertices = split_vertices(mesh, report);
}
