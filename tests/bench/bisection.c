#include "bisection.h"

#include "base/check.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

struct bisection {
    struct mesh mesh;
    vec3 *start, *way; // S', S'_max − S'
    double spacing;    // mean length of the sides
    double volume;     // inside S''
    double *blends, *falloffs, *distances;
    vec3 *moved;
};

static vec3 vector_of(const float *vectors, uint32_t vertex) {
    const float *v = vectors + 3 * (size_t)vertex;
    return (vec3){(double)v[0], (double)v[1], (double)v[2]};
}

static double mean_side(const struct bisection *b) {
    double sum = 0;
    const uint32_t *t = b->mesh.triangles;
    for (size_t i = 0; i < 3 * (size_t)b->mesh.triangle_count; i++)
        sum += vec3_distance(b->start[t[i]], b->start[t[i % 3 == 2 ? i - 2 : i + 1]]);
    return sum / (3.0 * b->mesh.triangle_count);
}

struct bisection *bisection_create(const struct mesh *mesh, const float *warp,
                                   const float *maxcut) {
    struct bisection *b = alloc(1, sizeof *b);
    uint32_t count = mesh->vertex_count;
    mesh_copy(&b->mesh, mesh);
    b->start = alloc(count, sizeof *b->start);
    b->way = alloc(count, sizeof *b->way);
    b->blends = alloc(count, sizeof *b->blends);
    b->falloffs = alloc(count, sizeof *b->falloffs);
    b->distances = alloc(count, sizeof *b->distances);
    b->moved = alloc(count, sizeof *b->moved);
    for (uint32_t v = 0; v < count; v++) {
        b->start[v] = vec3_add(mesh_vertex(mesh, v), warp ? vector_of(warp, v) : (vec3){0});
        b->way[v] = vector_of(maxcut, v);
    }
    b->spacing = mean_side(b);
    b->volume = bisection_volume(b);
    return b;
}

void bisection_destroy(struct bisection **bisection) {
    struct bisection *b = *bisection;
    if (!b)
        return;
    mesh_fini(&b->mesh);
    free(b->start);
    free(b->way);
    free(b->blends);
    free(b->falloffs);
    free(b->distances);
    free(b->moved);
    free(b);
    *bisection = NULL;
}

const double *bisection_blends(const struct bisection *bisection) {
    return bisection->blends;
}

// ---- the volume ---------------------------------------------------------------------------------

static double blend_at(const struct bisection *b, uint32_t vertex, double s) {
    return fmin(b->blends[vertex] + s * b->falloffs[vertex], 1);
}

static double volume_at(const struct bisection *b, double s) {
    const uint32_t *t = b->mesh.triangles;
    double six_volumes = 0;
    for (uint32_t v = 0; v < b->mesh.vertex_count; v++)
        b->moved[v] = vec3_add_scaled(b->start[v], blend_at(b, v, s), b->way[v]);
    vec3 origin = b->moved[t[0]]; // so that a far-off surface loses no digits
    for (uint32_t i = 0; i < b->mesh.triangle_count; i++, t += 3)
        six_volumes += vec3_dot(
            vec3_sub(b->moved[t[2]], origin),
            vec3_cross(vec3_sub(b->moved[t[0]], origin), vec3_sub(b->moved[t[1]], origin)));
    return six_volumes / 6;
}

double bisection_volume(const struct bisection *bisection) {
    return volume_at(bisection, 0);
}

// ---- brushes ------------------------------------------------------------------------------------

// Of p from the segment between S'' and S'_max, over the brush's radius, squared.
static double distance_from(const struct bisection *b, uint32_t v, const struct brush *brush) {
    vec3 way = b->way[v], at = vec3_add_scaled(b->start[v], b->blends[v], way);
    double along = vec3_dot(vec3_sub(brush->centre, at), way) / vec3_dot(way, way);
    at = vec3_add_scaled(at, fmax(0, fmin(along, 1 - b->blends[v])), way);
    double distance = vec3_distance(at, brush->centre) / fmax(brush->radius, b->spacing);
    return distance * distance;
}

static void measure_distances(struct bisection *b, const struct brush *brushes, int count) {
    for (uint32_t v = 0; v < b->mesh.vertex_count; v++) {
        bool moves = b->blends[v] < 1 && vec3_length(b->way[v]) > 0;
        b->distances[v] = INFINITY;
        for (int i = 0; moves && i < count; i++)
            b->distances[v] = fmin(b->distances[v], distance_from(b, v, &brushes[i]));
    }
}

static void put_brushes(struct bisection *b, double widening) {
    for (uint32_t v = 0; v < b->mesh.vertex_count; v++) {
        double distance = b->distances[v] / (widening * widening);
        b->falloffs[v] = distance < 1 ? 2 * (exp(-2 * distance) - exp(-2)) / (1 - exp(-2)) : 0;
    }
}

// ---- matching -----------------------------------------------------------------------------------

// V(1) first, so that it ends. False: the target is out of reach.
static bool bisect(struct bisection *b, double target, double tolerance,
                   struct match_report *report) {
    report->scale = 1;
    report->left_mm3 = volume_at(b, 1) - target;
    if (report->left_mm3 > tolerance)
        return false;
    double s = 0.5;
    for (double k = 0.25; fabs(report->left_mm3) > tolerance && k > DBL_EPSILON; k /= 2) {
        report->scale = s;
        report->left_mm3 = volume_at(b, s) - target;
        report->steps++;
        s += report->left_mm3 > 0 ? k : -k;
    }
    return true;
}

void bisection_match(struct bisection *b, const struct brush *brushes, int count, double target,
                     double tolerance, struct match_report *out) {
    *out = (struct match_report){
        .volume_mm3 = b->volume, .left_mm3 = b->volume - target, .widening = 1};
    if (target >= b->volume)
        return;
    measure_distances(b, brushes, count);
    put_brushes(b, out->widening);
    bool reached;
    while (!(reached = bisect(b, target, tolerance, out)) && out->widening < MATCH_WIDENING_MAX) {
        out->widening = fmin(1.5 * out->widening, MATCH_WIDENING_MAX);
        put_brushes(b, out->widening);
    }
    for (uint32_t v = 0; v < b->mesh.vertex_count; v++)
        b->blends[v] = blend_at(b, v, out->scale);
    out->outcome = reached ? MATCH_REACHED : MATCH_SATURATED;
    b->volume = out->volume_mm3 = target + out->left_mm3;
}
