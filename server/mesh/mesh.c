#include "mesh/mesh.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

#define COORDINATE_MAX_MM 1e4f

void mesh_init(struct mesh *mesh, uint32_t vertex_count, uint32_t triangle_count) {
    mesh->vertex_count = vertex_count;
    mesh->triangle_count = triangle_count;
    mesh->positions = alloc(3 * (size_t)vertex_count, sizeof *mesh->positions);
    mesh->triangles = alloc(3 * (size_t)triangle_count, sizeof *mesh->triangles);
}

void mesh_fini(struct mesh *mesh) {
    free(mesh->positions);
    free(mesh->triangles);
    *mesh = (struct mesh){0};
}

void mesh_copy(struct mesh *out, const struct mesh *mesh) {
    mesh_init(out, mesh->vertex_count, mesh->triangle_count);
    memcpy(out->positions, mesh->positions, 3 * (size_t)mesh->vertex_count * sizeof(float));
    memcpy(out->triangles, mesh->triangles, 3 * (size_t)mesh->triangle_count * sizeof(uint32_t));
}

static enum result validate_triangle(const struct mesh *mesh, uint32_t triangle,
                                     struct error *err) {
    const uint32_t *v = mesh->triangles + 3 * (size_t)triangle;
    for (int i = 0; i < 3; i++)
        if (v[i] >= mesh->vertex_count)
            return fail(err, RESULT_FORMAT, "triangle %u names vertex %u of %u", triangle, v[i],
                        mesh->vertex_count);
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0])
        return fail(err, RESULT_FORMAT, "triangle %u names a vertex twice", triangle);
    return RESULT_OK;
}

enum result mesh_validate(const struct mesh *mesh, struct error *err) {
    if (!mesh->triangle_count)
        return fail(err, RESULT_FORMAT, "it has no triangle");
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        if (!(mesh->positions[i] >= -COORDINATE_MAX_MM && mesh->positions[i] <= COORDINATE_MAX_MM))
            return fail(err, RESULT_INVALID, "vertex %zu lies at %g mm, beyond 10 m", i / 3,
                        (double)mesh->positions[i]);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        if (validate_triangle(mesh, t, err) != RESULT_OK)
            return RESULT_FORMAT;
    return RESULT_OK;
}

void mesh_set_vertex(struct mesh *mesh, uint32_t vertex, vec3 position) {
    CHECK(vertex < mesh->vertex_count);
    float *p = mesh->positions + 3 * (size_t)vertex;
    p[0] = (float)position.x;
    p[1] = (float)position.y;
    p[2] = (float)position.z;
}

void mesh_drop_unused(struct mesh *mesh) {
    uint32_t *place = alloc(mesh->vertex_count, sizeof *place);
    memset(place, 0xff, mesh->vertex_count * sizeof *place);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        place[mesh->triangles[i]] = 0;
    uint32_t count = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        if (place[v] == MESH_NONE)
            continue;
        place[v] = count;
        memmove(mesh->positions + 3 * (size_t)count++, mesh->positions + 3 * (size_t)v,
                3 * sizeof *mesh->positions);
    }
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        mesh->triangles[i] = place[mesh->triangles[i]];
    mesh->vertex_count = count;
    free(place);
}

uint32_t mesh_nearest_vertex(const struct mesh *mesh, vec3 p) {
    uint32_t nearest = 0;
    for (uint32_t v = 1; v < mesh->vertex_count; v++)
        if (vec3_distance(mesh_vertex(mesh, v), p) < vec3_distance(mesh_vertex(mesh, nearest), p))
            nearest = v;
    return nearest;
}

struct box mesh_bounds(const struct mesh *mesh) {
    CHECK(mesh->vertex_count > 0);
    struct box box = {mesh_vertex(mesh, 0), mesh_vertex(mesh, 0)};
    for (uint32_t i = 1; i < mesh->vertex_count; i++) {
        vec3 p = mesh_vertex(mesh, i);
        box = box_around(box, (struct box){p, p});
    }
    return box;
}

// About a point of the mesh, so that a far-off mesh loses no digits.
double mesh_volume(const struct mesh *mesh) {
    double six_volumes = 0;
    vec3 origin = mesh->triangle_count ? mesh_corner(mesh, 0, 0) : (vec3){0};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = vec3_sub(mesh_corner(mesh, t, 0), origin);
        vec3 b = vec3_sub(mesh_corner(mesh, t, 1), origin);
        vec3 c = vec3_sub(mesh_corner(mesh, t, 2), origin);
        six_volumes += vec3_dot(a, vec3_cross(b, c));
    }
    return six_volumes / 6;
}

double mesh_area(const struct mesh *mesh) {
    double two_areas = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0);
        vec3 ab = vec3_sub(mesh_corner(mesh, t, 1), a), ac = vec3_sub(mesh_corner(mesh, t, 2), a);
        two_areas += vec3_length(vec3_cross(ab, ac));
    }
    return two_areas / 2;
}
