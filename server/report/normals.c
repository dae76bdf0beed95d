#include "report/normals.h"

#include "base/check.h"

#include <stdlib.h>

// Twice the area long.
static vec3 *face_normals(const struct mesh *mesh) {
    vec3 *normals = alloc(mesh->triangle_count, sizeof *normals);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0);
        normals[t] =
            vec3_cross(vec3_sub(mesh_corner(mesh, t, 1), a), vec3_sub(mesh_corner(mesh, t, 2), a));
    }
    return normals;
}

// The triangles about vertex v are triangles[first[v]] to triangles[first[v + 1] - 1].
struct fans {
    uint32_t *first, *triangles;
};

static struct fans fans_create(const struct mesh *mesh) {
    size_t corners = 3 * (size_t)mesh->triangle_count;
    struct fans fans = {alloc((size_t)mesh->vertex_count + 2, sizeof *fans.first),
                        alloc(corners, sizeof *fans.triangles)};
    for (size_t i = 0; i < corners; i++)
        fans.first[mesh->triangles[i] + 2]++;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        fans.first[v + 2] += fans.first[v + 1];
    for (size_t i = 0; i < corners; i++)
        fans.triangles[fans.first[mesh->triangles[i] + 1]++] = (uint32_t)(i / 3);
    return fans;
}

vec3 *corner_normals(const struct mesh *mesh, double crease_deg) {
    vec3 *faces = face_normals(mesh);
    struct fans fans = fans_create(mesh);
    vec3 *normals = alloc(3 * (size_t)mesh->triangle_count, sizeof *normals);
    double least = cos(RAD_PER_DEG * crease_deg);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++) {
        vec3 own = vec3_unit_or(faces[i / 3], (vec3){0}), sum = {0};
        uint32_t vertex = mesh->triangles[i];
        for (uint32_t k = fans.first[vertex]; k < fans.first[vertex + 1]; k++) {
            vec3 other = faces[fans.triangles[k]];
            if (vec3_dot(own, other) >= least * vec3_length(other))
                sum = vec3_add(sum, other);
        }
        normals[i] = vec3_unit_or(sum, own);
    }
    free(faces);
    free(fans.first);
    free(fans.triangles);
    return normals;
}
