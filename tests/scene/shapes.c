#include "scene/shapes.h"

#include "base/check.h"
#include "random.h"

#include <stdlib.h>
#include <string.h>

#define TURN 6.283185307179586

static void set_triangle(struct mesh *mesh, uint32_t triangle, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *v = mesh->triangles + 3 * (size_t)triangle;
    v[0] = a;
    v[1] = b;
    v[2] = c;
}

// ---- the octahedron: rings of 1, 4, 8 … 4n … 8, 4, 1 vertices from top to bottom ----

static uint32_t ring_start(int n, int ring) {
    if (ring == 0)
        return 0;
    if (ring <= n)
        return (uint32_t)(1 + 2 * ring * (ring - 1));
    int rest = 2 * n - ring; // rings below have 4 · rest … vertices
    return (uint32_t)(4 * n * n + 2 - (1 + 2 * rest * (rest + 1)));
}

static uint32_t ring_vertex(int n, int ring, int step) {
    int width = ring < n ? ring : 2 * n - ring;
    return ring_start(n, ring) + (uint32_t)(width ? step % (4 * width) : 0);
}

static vec3 ring_position(int n, int ring, int step) {
    static const double corner[5][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 0}};
    int width = ring < n ? ring : 2 * n - ring;
    int quarter = width ? step / width : 0;
    double t = width ? (double)(step % width) / width : 0, r = (double)width / n;
    double x = (1 - t) * corner[quarter][0] + t * corner[quarter + 1][0];
    double y = (1 - t) * corner[quarter][1] + t * corner[quarter + 1][1];
    return vec3_unit_or((vec3){r * x, r * y, (double)(n - ring) / n}, (vec3){0});
}

// Between a ring of 4 · width vertices and the next larger one; `down` where the larger is below.
static uint32_t fill_band(struct mesh *out, uint32_t triangle, int n, int small, int large,
                          bool down) {
    int width = small < n ? small : 2 * n - small;
    for (int quarter = 0; quarter < 4; quarter++)
        for (int i = 0; i <= width; i++) {
            int s = quarter * width + i, l = quarter * (width + 1) + i;
            uint32_t a = ring_vertex(n, small, s), b = ring_vertex(n, large, l);
            uint32_t c = ring_vertex(n, large, l + 1);
            set_triangle(out, triangle++, a, down ? b : c, down ? c : b);
            if (i == width)
                continue;
            uint32_t d = ring_vertex(n, small, s + 1);
            set_triangle(out, triangle++, a, down ? c : d, down ? d : c);
        }
    return triangle;
}

void shape_sphere(struct mesh *out, double radius, int n) {
    mesh_init(out, (uint32_t)(4 * n * n + 2), (uint32_t)(8 * n * n));
    for (int ring = 0; ring <= 2 * n; ring++) {
        int width = ring < n ? ring : 2 * n - ring;
        for (int step = 0; step < (width ? 4 * width : 1); step++)
            mesh_set_vertex(out, ring_vertex(n, ring, step),
                            vec3_scale(radius, ring_position(n, ring, step)));
    }
    uint32_t triangle = 0;
    for (int ring = 0; ring < n; ring++)
        triangle = fill_band(out, triangle, n, ring, ring + 1, true);
    for (int ring = n; ring < 2 * n; ring++)
        triangle = fill_band(out, triangle, n, ring + 1, ring, false);
    CHECK(triangle == out->triangle_count);
}

// ---- other shapes ----

void shape_box(struct mesh *out, vec3 half) {
    static const uint32_t triangles[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    mesh_init(out, 8, 12);
    memcpy(out->triangles, triangles, sizeof triangles);
    for (uint32_t i = 0; i < 8; i++)
        mesh_set_vertex(
            out, i,
            (vec3){i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z});
}

// Squares of a sheet of rows × columns vertices whose ends may be joined.
static void fill_sheet(struct mesh *out, int squares_u, int squares_v, int rows, int columns) {
    uint32_t triangle = 0;
    for (int u = 0; u < squares_u; u++)
        for (int v = 0; v < squares_v; v++) {
            uint32_t a = (uint32_t)(u * columns + v);
            uint32_t b = (uint32_t)((u + 1) % rows * columns + v);
            uint32_t c = (uint32_t)((u + 1) % rows * columns + (v + 1) % columns);
            uint32_t d = (uint32_t)(u * columns + (v + 1) % columns);
            set_triangle(out, triangle++, a, b, c);
            set_triangle(out, triangle++, a, c, d);
        }
}

void shape_torus(struct mesh *out, double ring_radius, double tube_radius, int around, int across) {
    mesh_init(out, (uint32_t)(around * across), (uint32_t)(2 * around * across));
    for (int u = 0; u < around; u++)
        for (int v = 0; v < across; v++) {
            double a = TURN * u / around, b = TURN * v / across;
            double r = ring_radius + tube_radius * cos(b);
            mesh_set_vertex(out, (uint32_t)(u * across + v),
                            (vec3){r * cos(a), r * sin(a), tube_radius * sin(b)});
        }
    fill_sheet(out, around, across, around, across);
}

void shape_grid(struct mesh *out, double half, int n) {
    mesh_init(out, (uint32_t)((n + 1) * (n + 1)), (uint32_t)(2 * n * n));
    for (int u = 0; u <= n; u++)
        for (int v = 0; v <= n; v++)
            mesh_set_vertex(out, (uint32_t)(u * (n + 1) + v),
                            (vec3){half * (2.0 * u / n - 1), half * (2.0 * v / n - 1), 0});
    fill_sheet(out, n, n, n + 1, n + 1);
}

void shape_moebius(struct mesh *out, double radius, double half_width, int n) {
    mesh_init(out, (uint32_t)(2 * n), (uint32_t)(2 * n));
    for (int u = 0; u < n; u++)
        for (int side = 0; side < 2; side++) {
            double a = TURN * u / n, w = side ? half_width : -half_width;
            double r = radius + w * cos(a / 2);
            mesh_set_vertex(out, (uint32_t)(2 * u + side),
                            (vec3){r * cos(a), r * sin(a), w * sin(a / 2)});
        }
    fill_sheet(out, n - 1, 1, n, 2);
    uint32_t a = (uint32_t)(2 * n - 2), b = (uint32_t)(2 * n - 1); // the ends swap sides
    set_triangle(out, a, a, 1, 0);
    set_triangle(out, b, a, 0, b);
}

void shape_bumpy(struct mesh *out, vec3 radii, double bump_mm, int n, uint64_t seed) {
    struct random r = {seed};
    vec3 wave[6];
    double phase[6];
    for (int i = 0; i < 6; i++) {
        wave[i] = vec3_scale(random_between(&r, 2, 9), random_direction(&r));
        phase[i] = random_between(&r, 0, TURN);
    }
    shape_sphere(out, 1, n);
    for (uint32_t v = 0; v < out->vertex_count; v++) {
        vec3 u = mesh_vertex(out, v);
        double bump = 0;
        for (int i = 0; i < 6; i++)
            bump += bump_mm / 6 * sin(vec3_dot(wave[i], u) + phase[i]);
        vec3 p = {radii.x * u.x, radii.y * u.y, radii.z * u.z};
        mesh_set_vertex(out, v, vec3_add_scaled(p, bump, u));
    }
}

void shape_soup(struct mesh *out, double half, int triangles, uint64_t seed) {
    struct random r = {seed};
    mesh_init(out, (uint32_t)(3 * triangles), (uint32_t)triangles);
    for (uint32_t t = 0; t < (uint32_t)triangles; t++) {
        vec3 a = random_in_box(&r, half), b = random_in_box(&r, half), c = random_in_box(&r, half);
        double thin = pow(10, random_between(&r, -7, 0));
        vec3 on_line = vec3_lerp(a, b, random_between(&r, -0.2, 1.2));
        switch (t % 5) {
        case 1: // a needle with its third corner anywhere along it
            c = vec3_add_scaled(on_line, thin, random_direction(&r));
            break;
        case 2: // a needle with two corners together
            c = vec3_add_scaled(a, thin, random_direction(&r));
            break;
        case 3: // no area, but for rounding
            c = on_line;
            break;
        case 4: // no area
            c = t % 2 ? a : b;
            break;
        default:
            break;
        }
        mesh_set_vertex(out, 3 * t, a);
        mesh_set_vertex(out, 3 * t + 1, b);
        mesh_set_vertex(out, 3 * t + 2, c);
        set_triangle(out, t, 3 * t, 3 * t + 1, 3 * t + 2);
    }
}

// ---- changes ----

void shape_move(struct mesh *mesh, pose T_to_from) {
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh_set_vertex(mesh, v, pose_apply(T_to_from, mesh_vertex(mesh, v)));
}

void shape_scale(struct mesh *mesh, double factor) {
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh_set_vertex(mesh, v, vec3_scale(factor, mesh_vertex(mesh, v)));
}

void shape_append(struct mesh *mesh, const struct mesh *other) {
    struct mesh both;
    mesh_init(&both, mesh->vertex_count + other->vertex_count,
              mesh->triangle_count + other->triangle_count);
    size_t positions = 3 * (size_t)mesh->vertex_count, corners = 3 * (size_t)mesh->triangle_count;
    memcpy(both.positions, mesh->positions, positions * sizeof(float));
    memcpy(both.positions + positions, other->positions,
           3 * (size_t)other->vertex_count * sizeof(float));
    memcpy(both.triangles, mesh->triangles, corners * sizeof(uint32_t));
    for (size_t i = 0; i < 3 * (size_t)other->triangle_count; i++)
        both.triangles[corners + i] = mesh->vertex_count + other->triangles[i];
    mesh_fini(mesh);
    *mesh = both;
}

void shape_add_triangles(struct mesh *mesh, uint32_t count, const uint32_t *corners) {
    mesh->triangles =
        realloc(mesh->triangles, 3 * (size_t)(mesh->triangle_count + count) * sizeof(uint32_t));
    memcpy(mesh->triangles + 3 * (size_t)mesh->triangle_count, corners,
           3 * (size_t)count * sizeof(uint32_t));
    mesh->triangle_count += count;
}

float *shape_displacement(const struct mesh *mesh, double longest_mm, uint64_t seed) {
    struct random r = {seed};
    vec3 wave[3], direction[3];
    for (int i = 0; i < 3; i++) {
        wave[i] = vec3_scale(random_between(&r, 0.1, 0.3), random_direction(&r));
        direction[i] = vec3_scale(longest_mm / 3, random_direction(&r));
    }
    float *displacement = alloc(3 * (size_t)mesh->vertex_count, sizeof *displacement);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 d = {0};
        for (int i = 0; i < 3; i++)
            d = vec3_add_scaled(d, cos(vec3_dot(wave[i], mesh_vertex(mesh, v))), direction[i]);
        displacement[3 * (size_t)v] = (float)d.x;
        displacement[3 * (size_t)v + 1] = (float)d.y;
        displacement[3 * (size_t)v + 2] = (float)d.z;
    }
    return displacement;
}
