#include "landmarks/profile.h"

#include "base/check.h"

#include <stdlib.h>

static const double step = 0.8, unrolled_radius = 25; // mm: of the lattice, of a turn's length
static const double reach = 55;                       // of the femur from the axis, mm
static const double upper_part = 30;                  // of the tibia, mm

// The triangles of a mesh whose three corners `points` has kept (their x is no NAN).
static void heights_of(struct profile *profile, const struct mesh *mesh, vec3 *points) {
    struct mesh part = {.vertex_count = mesh->vertex_count};
    part.triangles = alloc(3 * (size_t)mesh->triangle_count, sizeof *part.triangles);
    const vec3 *any = NULL;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *c = mesh->triangles + 3 * (size_t)t;
        if (isnan(points[c[0]].x) || isnan(points[c[1]].x) || isnan(points[c[2]].x))
            continue;
        double low = fmin(points[c[0]].y, fmin(points[c[1]].y, points[c[2]].y));
        double high = fmax(points[c[0]].y, fmax(points[c[1]].y, points[c[2]].y));
        if (high - low > unrolled_radius)
            continue; // it goes round the end of the unrolled turn
        for (int i = 0; i < 3; i++)
            part.triangles[3 * (size_t)part.triangle_count + (size_t)i] = c[i];
        part.triangle_count++;
        any = &points[c[0]];
    }
    for (uint32_t v = 0; any && v < mesh->vertex_count; v++)
        if (isnan(points[v].x))
            points[v] = *any;
    *profile = (struct profile){0};
    if (any)
        columns_init(&profile->columns, &part, points, step);
    free(part.triangles);
}

void profile_unroll(struct profile *profile, const struct local *local, const struct mesh *femur) {
    vec3 *points = local_points(local, femur);
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = points[v];
        double radius = hypot(p.y, p.z);
        points[v] = (vec3){radius < reach && fabs(p.x) < reach ? p.x : NAN,
                           unrolled_radius * atan2(-p.y, -p.z), radius};
    }
    heights_of(profile, femur, points);
    free(points);
}

void profile_top(struct profile *profile, const struct local *local, const struct mesh *tibia) {
    vec3 *points = local_points(local, tibia);
    double top = -INFINITY;
    for (uint32_t v = 0; v < tibia->vertex_count; v++)
        if (hypot(points[v].x, points[v].y) < reach)
            top = fmax(top, points[v].z);
    for (uint32_t v = 0; v < tibia->vertex_count; v++)
        if (points[v].z < top - upper_part || hypot(points[v].x, points[v].y) > reach)
            points[v].x = NAN;
    heights_of(profile, tibia, points);
    free(points);
}

void profile_bottom(struct profile *profile, const struct local *local, const struct mesh *femur) {
    vec3 *points = local_points(local, femur);
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = points[v];
        bool near = hypot(p.x, p.y) < reach && p.z < reach;
        points[v] = (vec3){near ? p.x : NAN, p.y, -p.z};
    }
    heights_of(profile, femur, points);
    free(points);
}

void profile_fini(struct profile *profile) {
    columns_fini(&profile->columns);
}

static double column_top(const struct columns *c, int i, int j) {
    if (i < 0 || j < 0 || i >= c->nx || j >= c->ny)
        return NAN;
    size_t column = (size_t)j * (size_t)c->nx + (size_t)i, end = c->first[column + 1];
    return end > c->first[column] ? c->heights[end - 1] : NAN;
}

static double height_at(const struct columns *c, double x, double y) {
    if (!c->first || isnan(x) || isnan(y))
        return NAN;
    double u = (x - c->x) / c->step, v = (y - c->y) / c->step;
    int i = (int)floor(u), j = (int)floor(v);
    double s = u - i, t = v - j;
    return (1 - t) * ((1 - s) * column_top(c, i, j) + s * column_top(c, i + 1, j)) +
           t * ((1 - s) * column_top(c, i, j + 1) + s * column_top(c, i + 1, j + 1));
}

double profile_radius(const struct profile *profile, double x, double angle_deg) {
    return height_at(&profile->columns, x, unrolled_radius * angle_deg * RAD_PER_DEG);
}

double profile_height(const struct profile *profile, double x, double y) {
    return height_at(&profile->columns, x, y);
}

vec3 profile_place(double x, double angle_deg, double radius) {
    double angle = angle_deg * RAD_PER_DEG;
    return (vec3){x, -radius * sin(angle), -radius * cos(angle)};
}
