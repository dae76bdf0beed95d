#include "cut/cut_mesh.h"

#include <stdlib.h>

// ---- what a mesh must be ------------------------------------------------------------------------

// The twin runs back along the same edge: closed, oriented, two triangles at each edge.
static bool has_twin(const struct cut_mesh *m, uint32_t side) {
    uint32_t twin = m->twins[side];
    return twin < 3 * m->triangle_bound && m->twins[twin] == side &&
           m->corners[twin] == side_end(m, side) && side_end(m, twin) == m->corners[side];
}

static bool triangle_is_sound(const struct cut_mesh *m, uint32_t triangle) {
    const uint32_t *c = m->corners + 3 * (size_t)triangle;
    bool sound = c[0] != c[1] && c[1] != c[2] && c[2] != c[0] && m->labels[triangle] <= m->number;
    for (uint32_t i = 0; i < 3; i++)
        sound = sound && c[i] < m->vertex_bound && m->vertex_sides[c[i]] != MESH_NONE;
    for (uint32_t i = 0; sound && i < 3; i++)
        sound = has_twin(m, 3 * triangle + i);
    return sound;
}

static bool triangles_are_sound(const struct cut_mesh *m) {
    uint32_t living = 0;
    bool sound = true;
    for (uint32_t t = 0; sound && t < m->triangle_bound; t++) {
        if (!cut_mesh_triangle_alive(m, t))
            continue;
        living++;
        sound = triangle_is_sound(m, t);
    }
    return sound && living == m->living && living > 0;
}

static bool vertices_are_sound(const struct cut_mesh *m) {
    bool sound = true;
    for (uint32_t v = 0; sound && v < m->vertex_bound; v++) {
        uint32_t side = m->vertex_sides[v];
        vec3 p = m->points[v];
        sound = fabs(p.x) <= KEPT_FAR_MM && fabs(p.y) <= KEPT_FAR_MM && fabs(p.z) <= KEPT_FAR_MM &&
                (side == MESH_NONE || (side < 3 * m->triangle_bound && m->corners[side] == v));
    }
    return sound;
}

// Each of `dead` ids once, all of them dead and from `first` on.
static bool ids_are_free(const struct ids *ids, uint32_t first, uint32_t bound, uint32_t dead,
                         const uint32_t *marks, uint32_t stride) {
    bool *seen = alloc(bound, sizeof *seen);
    bool sound = ids->count == dead;
    for (uint32_t i = 0; sound && i < ids->count; i++) {
        uint32_t id = ids->at[i];
        sound = id >= first && id < bound && !seen[id] && marks[(size_t)stride * id] == MESH_NONE;
        if (sound)
            seen[id] = true;
    }
    free(seen);
    return sound;
}

static bool free_ids_are_sound(const struct cut_mesh *m) {
    uint32_t dead = 0;
    for (uint32_t v = m->original_count; v < m->vertex_bound; v++)
        dead += m->vertex_sides[v] == MESH_NONE;
    return ids_are_free(&m->free_vertices, m->original_count, m->vertex_bound, dead,
                        m->vertex_sides, 1) &&
           ids_are_free(&m->free_triangles, 0, m->triangle_bound, m->triangle_bound - m->living,
                        m->corners, 3);
}

// ---- keeping ------------------------------------------------------------------------------------

static void keep_array(struct kept *k, void **array, size_t count, size_t size) {
    void *read = kept_array(k, *array, count, size);
    if (!k->reads)
        return;
    free(*array);
    *array = read;
}

static void keep_ids(struct kept *k, struct ids *ids, uint32_t most) {
    kept_count(k, &ids->count, most);
    keep_array(k, (void **)&ids->at, ids->count, sizeof *ids->at);
    if (k->reads)
        ids->room = ids->count;
}

static void keep_content(struct cut_mesh *m, struct kept *k) {
    kept_count(k, &m->vertex_bound, UINT32_MAX / 4);
    kept_count(k, &m->triangle_bound, UINT32_MAX / 4);
    kept_count(k, &m->living, m->triangle_bound);
    kept_count(k, &m->number, UINT32_MAX - 1);
    kept_real(k, &m->volume, -HUGE_VAL, HUGE_VAL);
    kept_flag(k, &m->hollow);
    keep_array(k, (void **)&m->points, m->vertex_bound, sizeof *m->points);
    keep_array(k, (void **)&m->vertex_sides, m->vertex_bound, sizeof *m->vertex_sides);
    keep_array(k, (void **)&m->corners, m->triangle_bound, 3 * sizeof *m->corners);
    keep_array(k, (void **)&m->twins, m->triangle_bound, 3 * sizeof *m->twins);
    keep_array(k, (void **)&m->labels, m->triangle_bound, sizeof *m->labels);
    keep_ids(k, &m->free_vertices, m->vertex_bound);
    keep_ids(k, &m->free_triangles, m->triangle_bound);
}

static void fill_grid(struct cut_mesh *m) {
    grid_clear(&m->grid);
    for (uint32_t t = 0; t < m->triangle_bound; t++) {
        vec3 points[3];
        if (!cut_mesh_triangle_alive(m, t))
            continue;
        triangle_points(m, m->corners + 3 * (size_t)t, points);
        grid_add(&m->grid, t, points);
    }
}

// The order in the grid's cells may be another one: no cut depends on it (near.c, ray.c).
void cut_mesh_keep(struct cut_mesh **mesh, const struct cut_mesh *whole, struct kept *k) {
    if (k->reads)
        *mesh = cut_mesh_copy(whole);
    struct cut_mesh *m = *mesh;
    keep_content(m, k);
    if (!k->reads)
        return;
    m->vertex_room = m->vertex_bound;
    m->triangle_room = m->triangle_bound;
    kept_holds(k, m->vertex_bound >= m->original_count && isfinite(m->volume));
    kept_holds(k,
               !k->bad && vertices_are_sound(m) && triangles_are_sound(m) && free_ids_are_sound(m));
    if (k->bad)
        cut_mesh_destroy(mesh);
    else
        fill_grid(m);
}
