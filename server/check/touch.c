#include "check/touch.h"

#include "base/check.h"
#include "mesh/edges.h"
#include "mesh/topology.h"

#include <stdlib.h>
#include <string.h>

// Cartilage is seldom thinner where bone lies below it.
#define BURIED_MM 0.5

// Normals of a scan that crosses itself tell the side wrongly, even far away. Farther than a
// column's step from the surface, the nearest column tells it.
#define COLUMN_MM 0.7
#define COLUMNS_ACROSS_MAX 1000 // fewer of a giant

// So that edges of made meshes, which like round numbers, do not meet a column.
static const quat columns_turn = {0.8775825618903728, 0.2766111292005314, 0.17287446249211852,
                                  0.35135388212797386};

// ---- shells -------------------------------------------------------------------------------------

// The triangles of a mesh that are wanted, with their vertices alone.
static void select_triangles(const struct mesh *mesh, const bool *wanted, struct mesh *out) {
    uint32_t *number = alloc(mesh->vertex_count, sizeof *number), vertices = 0, triangles = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int i = 0; wanted[t] && i < 3; i++)
            number[mesh->triangles[3 * (size_t)t + (size_t)i]] = 1;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        number[v] = number[v] ? vertices++ : MESH_NONE;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        triangles += wanted[t];
    mesh_init(out, vertices, triangles);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        if (number[v] != MESH_NONE)
            memcpy(out->positions + 3 * (size_t)number[v], mesh->positions + 3 * (size_t)v,
                   3 * sizeof(float));
    uint32_t *to = out->triangles;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int i = 0; wanted[t] && i < 3; i++)
            *to++ = number[mesh->triangles[3 * (size_t)t + (size_t)i]];
    free(number);
}

static bool *border_of(const struct mesh *mesh) {
    size_t count = 3 * (size_t)mesh->triangle_count, end;
    struct triangle_side *sides = edges_sorted(mesh);
    bool *border = alloc(mesh->vertex_count, sizeof *border);
    for (size_t i = 0; i < count; i = end) {
        end = edges_end(sides, i, count);
        if (end == i + 1)
            border[sides[i].low] = border[sides[i].high] = true;
    }
    free(sides);
    return border;
}

static void stand_columns(struct shell *shell) {
    vec3 *points = alloc(shell->mesh.vertex_count, sizeof *points);
    for (uint32_t v = 0; v < shell->mesh.vertex_count; v++)
        points[v] = quat_rotate(columns_turn, mesh_vertex(&shell->mesh, v));
    double across = vec3_distance(shell->box.min, shell->box.max);
    columns_init(&shell->columns, &shell->mesh, points,
                 fmax(COLUMN_MM, across / COLUMNS_ACROSS_MAX));
    free(points);
}

static enum result shell_init(struct shell *shell, const struct mesh *mesh, const bool *wanted,
                              struct error *err) {
    select_triangles(mesh, wanted, &shell->mesh);
    shell->box = mesh_bounds(&shell->mesh);
    if (topology_of(&shell->mesh).closed)
        stand_columns(shell);
    else
        shell->border = border_of(&shell->mesh);
    return solid_init(&shell->solid, &shell->mesh, err);
}

static void shell_fini(struct shell *shell) {
    if (shell->solid.mesh)
        solid_fini(&shell->solid);
    mesh_fini(&shell->mesh);
    columns_fini(&shell->columns);
    free(shell->border);
}

// By the column that stands nearest, at the height of p.
static bool is_in_column(const struct columns *columns, vec3 at) {
    vec3 p = quat_rotate(columns_turn, at);
    long i = lround((p.x - columns->x) / columns->step);
    long j = lround((p.y - columns->y) / columns->step);
    if (i < 0 || j < 0 || i >= columns->nx || j >= columns->ny)
        return false;
    size_t column = (size_t)j * (size_t)columns->nx + (size_t)i, below = 0;
    for (size_t k = columns->first[column]; k < columns->first[column + 1]; k++)
        below += columns->heights[k] < p.z;
    return below % 2 == 1;
}

static bool is_past_border(const struct shell *shell, const struct closest *closest) {
    if (!shell->border || closest->feature == FEATURE_FACE)
        return false;
    const uint32_t *corners = shell->mesh.triangles + 3 * (size_t)closest->triangle;
    if (closest->feature == FEATURE_VERTEX)
        return shell->border[corners[closest->corner]];
    size_t slot = 3 * (size_t)closest->triangle + (size_t)closest->corner;
    return shell->solid.neighbours[slot] == MESH_NONE;
}

static double distance_to_shell(const struct shell *shell, vec3 p, uint32_t *hint,
                                vec3 *out_point) {
    struct closest closest;
    bool found = query_closest(shell->solid.query, p, INFINITY, *hint, &closest);
    CHECK(found);
    *hint = closest.triangle;
    *out_point = closest.point;
    if (is_past_border(shell, &closest))
        return closest.distance;
    if (!shell->border && closest.distance > shell->columns.step)
        return is_in_column(&shell->columns, p) ? -closest.distance : closest.distance;
    return solid_signed(&shell->solid, p, &closest);
}

// ---- groups -------------------------------------------------------------------------------------

// 0 inside the shell's box; nothing of a closed shell is nearer.
static double distance_to_box(const struct shell *shell, vec3 p) {
    struct box b = shell->box;
    vec3 off = {fmax(fmax(b.min.x - p.x, p.x - b.max.x), 0),
                fmax(fmax(b.min.y - p.y, p.y - b.max.y), 0),
                fmax(fmax(b.min.z - p.z, p.z - b.max.z), 0)};
    return vec3_length(off);
}

void touching_forget(struct touching_hints *hints) {
    for (int i = 0; i <= SHELLS_MAX; i++)
        hints->triangles[i] = MESH_NONE;
}

static bool is_buried(const struct touching *touching, int shell, vec3 p,
                      struct touching_hints *hints) {
    vec3 point;
    for (int i = 0; i < touching->shell_count; i++)
        if (i != shell && distance_to_box(&touching->shells[i], p) == 0 &&
            distance_to_shell(&touching->shells[i], p, &hints->triangles[i], &point) < 0)
            return true;
    return false;
}

static vec3 before(const struct shell *shell, uint32_t triangle, double mm) {
    vec3 sum = {0};
    for (int i = 0; i < 3; i++)
        sum = vec3_add_scaled(sum, 1.0 / 3, mesh_corner(&shell->mesh, triangle, i));
    return vec3_add_scaled(sum, mm, shell->solid.face_normals[triangle]);
}

static void join(const struct mesh *from, struct mesh *to, uint32_t *vertices,
                 uint32_t *triangles) {
    memcpy(to->positions + 3 * (size_t)*vertices, from->positions,
           3 * (size_t)from->vertex_count * sizeof(float));
    for (size_t i = 0; i < 3 * (size_t)from->triangle_count; i++)
        to->triangles[3 * (size_t)*triangles + i] = from->triangles[i] + *vertices;
    *vertices += from->vertex_count;
    *triangles += from->triangle_count;
}

static enum result find_surface(struct touching *touching, struct error *err) {
    uint32_t vertices = 0, triangles = 0;
    for (int i = 0; i < touching->shell_count; i++) {
        vertices += touching->shells[i].mesh.vertex_count;
        triangles += touching->shells[i].mesh.triangle_count;
    }
    struct mesh all;
    mesh_init(&all, vertices, triangles);
    bool *bare = alloc(triangles, sizeof *bare);
    struct touching_hints hints;
    touching_forget(&hints);
    vertices = triangles = 0;
    for (int i = 0; i < touching->shell_count; i++) {
        const struct shell *shell = &touching->shells[i];
        for (uint32_t t = 0; t < shell->mesh.triangle_count; t++)
            bare[triangles + t] = !is_buried(touching, i, before(shell, t, BURIED_MM), &hints);
        join(&shell->mesh, &all, &vertices, &triangles);
    }
    enum result result = shell_init(&touching->surface, &all, bare, err);
    mesh_fini(&all);
    free(bare);
    return result;
}

// The shell that each triangle belongs to: the set of its vertices.
static uint32_t *sets_of(const struct mesh *mesh) {
    uint32_t *sets = sets_create(mesh->vertex_count);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *v = mesh->triangles + 3 * (size_t)t;
        sets_join(sets, v[0], v[1]);
        sets_join(sets, v[1], v[2]);
    }
    return sets;
}

// The wall of a hollow is no shell: hollows count as filled.
static enum result add_shell(struct touching *touching, const struct mesh *mesh, const bool *wanted,
                             struct error *err) {
    struct shell *shell = &touching->shells[touching->shell_count];
    enum result result = shell_init(shell, mesh, wanted, err);
    touching->shell_count++;
    if (result == RESULT_OK && !shell->border && mesh_volume(&shell->mesh) <= 0) {
        shell_fini(shell);
        *shell = (struct shell){0};
        touching->shell_count--;
    }
    return result;
}

static enum result find_shells(struct touching *touching, const struct mesh *mesh,
                               struct error *err) {
    uint32_t *sets = sets_of(mesh);
    bool *done = alloc(mesh->triangle_count, sizeof *done);
    bool *wanted = alloc(mesh->triangle_count, sizeof *wanted);
    enum result result = RESULT_OK;
    for (uint32_t t = 0; t < mesh->triangle_count && result == RESULT_OK; t++) {
        if (done[t] || touching->shell_count == SHELLS_MAX)
            continue;
        uint32_t set = sets_find(sets, mesh->triangles[3 * (size_t)t]);
        for (uint32_t i = t; i < mesh->triangle_count; i++) {
            wanted[i] = sets_find(sets, mesh->triangles[3 * (size_t)i]) == set;
            done[i] |= wanted[i];
        }
        result = add_shell(touching, mesh, wanted, err);
    }
    free(sets);
    free(done);
    free(wanted);
    return result;
}

enum result touching_init(struct touching *touching, const struct mesh *mesh, struct error *err) {
    *touching = (struct touching){0};
    enum result result = find_shells(touching, mesh, err);
    if (result == RESULT_OK && touching->shell_count > 1)
        result = find_surface(touching, err);
    return result;
}

void touching_fini(struct touching *touching) {
    for (int i = 0; i < touching->shell_count; i++)
        shell_fini(&touching->shells[i]);
    shell_fini(&touching->surface);
    *touching = (struct touching){0};
}

const struct shell *touching_surface(const struct touching *touching) {
    return touching->shell_count == 1 ? &touching->shells[0] : &touching->surface;
}

double touching_distance(const struct touching *touching, vec3 p, struct touching_hints *hints,
                         vec3 *out_point) {
    double least = INFINITY;
    for (int i = 0; i < touching->shell_count && least >= 0; i++) {
        vec3 point;
        if (!touching->shells[i].border && distance_to_box(&touching->shells[i], p) >= least)
            continue;
        double distance = distance_to_shell(&touching->shells[i], p, &hints->triangles[i], &point);
        if (distance < least) {
            least = distance;
            *out_point = point;
        }
    }
    if (least >= 0 || touching->shell_count == 1)
        return least;
    struct closest closest;
    uint32_t *hint = &hints->triangles[SHELLS_MAX];
    bool found = query_closest(touching->surface.solid.query, p, INFINITY, *hint, &closest);
    CHECK(found);
    *hint = closest.triangle;
    *out_point = closest.point;
    return -closest.distance;
}

// ---- gaps ---------------------------------------------------------------------------------------

#define FIRST_STRIDE 61 // a first look at some vertices makes the look at all of them short

struct nearest {
    double mm;
    vec3 vertex, point; // in the frame of the mesh that the vertex is not of
};

static void look_near(const struct mesh *mesh, uint32_t stride, pose T_to_mesh,
                      const struct shell *to, struct nearest *nearest) {
    for (uint32_t v = 0; v < mesh->vertex_count; v += stride) {
        struct closest closest;
        vec3 p = pose_apply(T_to_mesh, mesh_vertex(mesh, v));
        if (query_closest(to->solid.query, p, nearest->mm, MESH_NONE, &closest) &&
            closest.distance < nearest->mm)
            *nearest = (struct nearest){closest.distance, p, closest.point};
    }
}

struct gap gap_of(const struct touching *a, const struct touching *b, pose T_a_b) {
    if (!a->shell_count || !b->shell_count)
        return (struct gap){.mm = INFINITY};
    const struct shell *on_a = touching_surface(a), *on_b = touching_surface(b);
    struct nearest of_b = {.mm = INFINITY}, of_a = {.mm = INFINITY};
    for (int pass = 0; pass < 2; pass++) {
        uint32_t stride = pass ? 1 : FIRST_STRIDE;
        look_near(&on_b->mesh, stride, T_a_b, on_a, &of_b);
        of_a.mm = fmin(of_a.mm, of_b.mm);
        look_near(&on_a->mesh, stride, pose_inverse(T_a_b), on_b, &of_a);
    }
    return of_a.mm < of_b.mm ? (struct gap){of_a.mm, pose_apply(T_a_b, of_a.vertex)}
                             : (struct gap){of_b.mm, of_b.point};
}
