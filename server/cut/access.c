#include "cut/cut_mesh.h"

#include <stdlib.h>

uint32_t cut_mesh_vertex_bound(const struct cut_mesh *mesh) {
    return mesh->vertex_bound;
}

uint32_t cut_mesh_triangle_bound(const struct cut_mesh *mesh) {
    return mesh->triangle_bound;
}

uint32_t cut_mesh_triangle_count(const struct cut_mesh *mesh) {
    return mesh->living;
}

bool cut_mesh_vertex_alive(const struct cut_mesh *mesh, uint32_t vertex) {
    CHECK(vertex < mesh->vertex_bound);
    return mesh->vertex_sides[vertex] != MESH_NONE;
}

bool cut_mesh_triangle_alive(const struct cut_mesh *mesh, uint32_t triangle) {
    CHECK(triangle < mesh->triangle_bound);
    return mesh->corners[3 * (size_t)triangle] != MESH_NONE;
}

vec3 cut_mesh_vertex(const struct cut_mesh *mesh, uint32_t vertex) {
    CHECK(vertex < mesh->vertex_bound);
    return mesh->points[vertex];
}

const uint32_t *cut_mesh_triangle(const struct cut_mesh *mesh, uint32_t triangle) {
    CHECK(triangle < mesh->triangle_bound);
    return mesh->corners + 3 * (size_t)triangle;
}

uint32_t cut_mesh_label(const struct cut_mesh *mesh, uint32_t triangle) {
    CHECK(triangle < mesh->triangle_bound);
    return mesh->labels[triangle];
}

double cut_mesh_volume(const struct cut_mesh *mesh) {
    double sum = 0;
    for (uint32_t t = 0; t < mesh->triangle_bound; t++) {
        if (!cut_mesh_triangle_alive(mesh, t))
            continue;
        vec3 points[3];
        triangle_points(mesh, mesh->corners + 3 * (size_t)t, points);
        sum += six_volumes(points, mesh->grid.origin);
    }
    return sum / 6;
}

void cut_mesh_flatten(const struct cut_mesh *mesh, struct mesh *out, uint32_t **out_vertices,
                      uint32_t **out_triangles) {
    uint32_t vertices = 0, triangles = 0;
    for (uint32_t v = 0; v < mesh->vertex_bound; v++)
        vertices += cut_mesh_vertex_alive(mesh, v);
    mesh_init(out, vertices, mesh->living);
    uint32_t *names = alloc(mesh->vertex_bound, sizeof *names);
    uint32_t *vertex_ids = alloc(vertices, sizeof *vertex_ids);
    uint32_t *triangle_ids = alloc(mesh->living, sizeof *triangle_ids);
    vertices = 0;
    for (uint32_t v = 0; v < mesh->vertex_bound; v++)
        if (cut_mesh_vertex_alive(mesh, v)) {
            mesh_set_vertex(out, names[v] = vertices, mesh->points[v]);
            vertex_ids[vertices++] = v;
        }
    for (uint32_t t = 0; t < mesh->triangle_bound; t++)
        if (cut_mesh_triangle_alive(mesh, t)) {
            for (size_t i = 0; i < 3; i++)
                out->triangles[3 * (size_t)triangles + i] = names[mesh->corners[3 * (size_t)t + i]];
            triangle_ids[triangles++] = t;
        }
    free(names);
    if (out_vertices)
        *out_vertices = vertex_ids;
    else
        free(vertex_ids);
    if (out_triangles)
        *out_triangles = triangle_ids;
    else
        free(triangle_ids);
}
