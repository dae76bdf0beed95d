#include "report/rods.h"

#define SIDES 6
#define VERTICES (2 * SIDES)
#define TRIANGLES (4 * SIDES - 4) // the sides, and a fan at each end

static void add_triangle(struct mesh *mesh, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *triangle = mesh->triangles + 3 * (size_t)mesh->triangle_count++;
    triangle[0] = mesh->vertex_count + a;
    triangle[1] = mesh->vertex_count + b;
    triangle[2] = mesh->vertex_count + c;
}

static void add_rod(struct mesh *mesh, const struct rod *line, double radius) {
    vec3 along = vec3_unit_or(vec3_sub(line->to, line->from), (vec3){0});
    vec3 other = fabs(along.x) < 0.6 ? (vec3){1, 0, 0} : (vec3){0, 1, 0};
    vec3 x = vec3_unit_or(vec3_cross(along, other), (vec3){0}), y = vec3_cross(along, x);
    for (uint32_t i = 0; i < SIDES; i++) {
        uint32_t next = (i + 1) % SIDES;
        double angle = 2 * M_PI * i / SIDES;
        vec3 out = vec3_add_scaled(vec3_scale(radius * cos(angle), x), radius * sin(angle), y);
        float *p = mesh->positions + 3 * ((size_t)mesh->vertex_count + i);
        vec3 ends[2] = {vec3_add(line->from, out), vec3_add(line->to, out)};
        for (size_t end = 0; end < 2; end++) {
            p[3 * SIDES * end] = (float)ends[end].x;
            p[3 * SIDES * end + 1] = (float)ends[end].y;
            p[3 * SIDES * end + 2] = (float)ends[end].z;
        }
        add_triangle(mesh, i, next, SIDES + next);
        add_triangle(mesh, i, SIDES + next, SIDES + i);
    }
    for (uint32_t i = 1; i + 1 < SIDES; i++) {
        add_triangle(mesh, 0, i + 1, i);
        add_triangle(mesh, SIDES, SIDES + i, SIDES + i + 1);
    }
    mesh->vertex_count += VERTICES;
}

void rods_mesh(const struct rod *rods, size_t count, double radius_mm, struct mesh *out_mesh) {
    mesh_init(out_mesh, (uint32_t)count * VERTICES, (uint32_t)count * TRIANGLES);
    out_mesh->vertex_count = out_mesh->triangle_count = 0;
    for (size_t i = 0; i < count; i++)
        if (vec3_distance(rods[i].from, rods[i].to) > 0)
            add_rod(out_mesh, &rods[i], radius_mm);
}
