#include "scene/tissue.h"

#include "base/check.h"
#include "generate/tube.h"
#include "random.h"
#include "scene/shapes.h"

#include <stdlib.h>
#include <string.h>

static void set_vector(float *vectors, uint32_t vertex, vec3 v) {
    vectors[3 * vertex] = (float)v.x;
    vectors[3 * vertex + 1] = (float)v.y;
    vectors[3 * vertex + 2] = (float)v.z;
}

static vec3 vector_of(const float *vectors, uint32_t vertex) {
    if (!vectors)
        return (vec3){0};
    const float *v = vectors + 3 * (size_t)vertex;
    return (vec3){(double)v[0], (double)v[1], (double)v[2]};
}

// Takes the mesh and both displacements.
static void tissue_init(struct tissue *out, struct mesh mesh, float *warp, float *maxcut) {
    *out = (struct tissue){.mesh = mesh, .warp = warp, .maxcut = maxcut};
    out->surface = match_surface_create(&mesh, warp, maxcut);
    out->match = match_create(out->surface);
    out->before = alloc(mesh.vertex_count, sizeof *out->before);
}

void tissue_fini(struct tissue *tissue) {
    match_destroy(&tissue->match);
    match_surface_destroy(&tissue->surface);
    mesh_fini(&tissue->mesh);
    free(tissue->warp);
    free(tissue->maxcut);
    free(tissue->before);
}

static float *inward(const struct mesh *mesh, double most_mm) {
    float *way = alloc(3 * (size_t)mesh->vertex_count, sizeof *way);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 up = vec3_unit_or(mesh_vertex(mesh, v), (vec3){0});
        set_vector(way, v, vec3_scale(-most_mm * fmax(0, up.z), up));
    }
    return way;
}

void tissue_sphere(struct tissue *out, int n, double most_mm) {
    struct mesh mesh;
    shape_sphere(&mesh, 10, n);
    tissue_init(out, mesh, shape_displacement(&mesh, 0.5, 7), inward(&mesh, most_mm));
}

void tissue_uneven(struct tissue *out, int n, uint64_t seed) {
    struct mesh mesh;
    shape_sphere(&mesh, 10, n);
    struct random r = {seed};
    float *way = alloc(3 * (size_t)mesh.vertex_count, sizeof *way);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        vec3 up = vec3_unit_or(mesh_vertex(&mesh, v), (vec3){0});
        set_vector(way, v, vec3_scale(up.x < 0 ? -2 : random_between(&r, 0, 5), up));
    }
    tissue_init(out, mesh, NULL, way);
}

void tissue_meniscus(struct tissue *out) {
    const vec3 middle = {-21, -1, 0}; // of the medial compartment; the body lies at smaller x
    struct mesh mesh;
    CHECK(tube_meniscus(false, 2360, 1, &mesh));
    float *way = alloc(3 * (size_t)mesh.vertex_count, sizeof *way);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        vec3 off = vec3_sub(mesh_vertex(&mesh, v), middle);
        double across = hypot(off.x, off.y);
        double length = fmax(0, 16 - across) * fmax(0, -off.x / across);
        set_vector(way, v, vec3_scale(0.6 * length / across, (vec3){off.x, off.y, 0}));
    }
    tissue_init(out, mesh, shape_displacement(&mesh, 0.3, 3), way);
}

vec3 tissue_place(const struct tissue *tissue, uint32_t vertex, double blend) {
    vec3 start = vec3_add(mesh_vertex(&tissue->mesh, vertex), vector_of(tissue->warp, vertex));
    return vec3_add_scaled(start, blend, vector_of(tissue->maxcut, vertex));
}

double tissue_way(const struct tissue *tissue, uint32_t vertex) {
    return vec3_length(vector_of(tissue->maxcut, vertex));
}

void tissue_remember(struct tissue *tissue) {
    memcpy(tissue->before, match_blends(tissue->match),
           tissue->mesh.vertex_count * sizeof *tissue->before);
}

// ---- oracles ----

double tissue_volume(const struct tissue *tissue, const double *blends) {
    long double sum = 0;
    const uint32_t *t = tissue->mesh.triangles;
    for (uint32_t i = 0; i < tissue->mesh.triangle_count; i++, t += 3) {
        vec3 p[3];
        for (int k = 0; k < 3; k++)
            p[k] = tissue_place(tissue, t[k], blends[t[k]]);
        long double x = (long double)p[1].y * p[2].z - (long double)p[1].z * p[2].y;
        long double y = (long double)p[1].z * p[2].x - (long double)p[1].x * p[2].z;
        long double z = (long double)p[1].x * p[2].y - (long double)p[1].y * p[2].x;
        sum += x * p[0].x + y * p[0].y + z * p[0].z;
    }
    return (double)(sum / 6);
}

// By thirds: the distance is a convex function of the place on the segment.
static double distance_from_segment(vec3 from, vec3 to, vec3 p) {
    double low = 0, high = 1;
    for (int i = 0; i < 150; i++) {
        double a = low + (high - low) / 3, b = high - (high - low) / 3;
        if (vec3_distance(vec3_lerp(from, to, a), p) < vec3_distance(vec3_lerp(from, to, b), p))
            high = b;
        else
            low = a;
    }
    return vec3_distance(vec3_lerp(from, to, low), p);
}

double *tissue_falloffs(const struct tissue *tissue, const struct brush *brushes, int count,
                        double widening) {
    double *b = alloc(tissue->mesh.vertex_count, sizeof *b);
    for (uint32_t v = 0; v < tissue->mesh.vertex_count; v++) {
        vec3 from = tissue_place(tissue, v, tissue->before[v]), to = tissue_place(tissue, v, 1);
        if (tissue->before[v] >= 1 || tissue_way(tissue, v) == 0)
            continue;
        for (int i = 0; i < count; i++) {
            double d = distance_from_segment(from, to, brushes[i].centre);
            double h = widening * brushes[i].radius;
            if (d < h)
                b[v] = fmax(b[v], 2 * (exp(-2 * d * d / (h * h)) - exp(-2)) / (1 - exp(-2)));
        }
    }
    return b;
}

double tissue_volume_at(const struct tissue *tissue, const double *falloffs, double s) {
    double *blends = alloc(tissue->mesh.vertex_count, sizeof *blends);
    for (uint32_t v = 0; v < tissue->mesh.vertex_count; v++)
        blends[v] = fmin(tissue->before[v] + s * falloffs[v], 1);
    double volume = tissue_volume(tissue, blends);
    free(blends);
    return volume;
}
