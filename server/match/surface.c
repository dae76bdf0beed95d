#include "match/surface.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

static vec3 vector_of(const float *vectors, uint32_t vertex) {
    const float *v = vectors + 3 * (size_t)vertex;
    return (vec3){(double)v[0], (double)v[1], (double)v[2]};
}

static void place_vertices(struct match_surface *surface, const struct mesh *mesh,
                           const float *warp, const float *maxcut) {
    surface->start = alloc(mesh->vertex_count, sizeof *surface->start);
    surface->way = alloc(mesh->vertex_count, sizeof *surface->way);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 moved = warp ? vector_of(warp, v) : (vec3){0};
        surface->start[v] = vec3_add(mesh_vertex(mesh, v), moved);
        surface->way[v] = vector_of(maxcut, v);
    }
}

static void link_fans(struct match_surface *surface) {
    size_t corners = 3 * (size_t)surface->triangle_count;
    const uint32_t *t = surface->triangles;
    uint32_t *first = alloc((size_t)surface->vertex_count + 2, sizeof *first);
    for (size_t i = 0; i < corners; i++)
        first[t[i] + 2]++;
    for (uint32_t v = 0; v < surface->vertex_count; v++)
        first[v + 2] += first[v + 1];
    surface->first = first;
    surface->opposites = alloc(corners, sizeof *surface->opposites);
    for (size_t i = 0; i < corners; i++) { // first[v + 1] grows from the fan's start to its end
        size_t corner = i % 3, triangle = i - corner;
        surface->opposites[first[t[i] + 1]++] =
            (struct opposite){t[triangle + (corner + 1) % 3], t[triangle + (corner + 2) % 3]};
    }
}

static double mean_side(const struct match_surface *surface) {
    double sum = 0;
    size_t corners = 3 * (size_t)surface->triangle_count;
    for (size_t i = 0; i < corners; i++)
        sum += vec3_distance(surface->start[surface->opposites[i].from],
                             surface->start[surface->opposites[i].to]);
    return sum / (double)corners;
}

static double least_volume(const struct match_surface *surface) {
    vec3 *end = alloc(surface->vertex_count, sizeof *end);
    for (uint32_t v = 0; v < surface->vertex_count; v++)
        end[v] = vec3_add(surface->start[v], surface->way[v]);
    double volume = surface_volume(surface, end);
    free(end);
    return volume;
}

struct match_surface *match_surface_create(const struct mesh *mesh, const float *warp,
                                           const float *maxcut) {
    CHECK(mesh->triangle_count > 0);
    struct match_surface *surface = alloc(1, sizeof *surface);
    surface->vertex_count = mesh->vertex_count;
    surface->triangle_count = mesh->triangle_count;
    size_t corners = 3 * (size_t)mesh->triangle_count;
    surface->triangles = alloc(corners, sizeof *surface->triangles);
    memcpy(surface->triangles, mesh->triangles, corners * sizeof *surface->triangles);
    place_vertices(surface, mesh, warp, maxcut);
    link_fans(surface);
    surface->spacing = mean_side(surface);
    surface->volume = surface_volume(surface, surface->start);
    surface->least = least_volume(surface);
    return surface;
}

void match_surface_destroy(struct match_surface **surface) {
    if (!*surface)
        return;
    free((*surface)->triangles);
    free((*surface)->start);
    free((*surface)->way);
    free((*surface)->first);
    free((*surface)->opposites);
    free(*surface);
    *surface = NULL;
}

double match_surface_volume(const struct match_surface *surface) {
    return surface->volume;
}

double match_surface_least(const struct match_surface *surface) {
    return surface->least;
}

// About a vertex, so that a far-off surface loses no digits.
double surface_volume(const struct match_surface *surface, const vec3 *positions) {
    double six_volumes = 0;
    const uint32_t *t = surface->triangles;
    vec3 origin = positions[t[0]];
    for (size_t i = 0; i < surface->triangle_count; i++, t += 3) {
        vec3 a = vec3_sub(positions[t[0]], origin), b = vec3_sub(positions[t[1]], origin);
        six_volumes += vec3_dot(vec3_sub(positions[t[2]], origin), vec3_cross(a, b));
    }
    return six_volumes / 6;
}
