#include "scene/brute.h"

typedef struct wide {
    long double x, y, z;
} wide;

static wide wide_sub(vec3 a, vec3 b) {
    return (wide){(long double)a.x - b.x, (long double)a.y - b.y, (long double)a.z - b.z};
}

static long double wide_dot(wide a, wide b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static wide wide_cross(wide a, wide b) {
    return (wide){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static long double wide_length(wide a) {
    return sqrtl(wide_dot(a, a));
}

static long double to_side(vec3 p, vec3 from, vec3 to) {
    wide side = wide_sub(to, from), off = wide_sub(p, from), back = wide_sub(p, to);
    if (wide_dot(side, off) <= 0)
        return wide_length(off);
    if (wide_dot(side, back) >= 0)
        return wide_length(back);
    return wide_length(wide_cross(side, off)) / wide_length(side);
}

static long double to_triangle(vec3 p, const vec3 corner[3]) {
    wide normal = wide_cross(wide_sub(corner[1], corner[0]), wide_sub(corner[2], corner[0]));
    long double area = wide_length(normal), best = INFINITY;
    bool inside = area > 1e-12L;
    for (int i = 0; i < 3; i++) {
        vec3 from = corner[i], to = corner[(i + 1) % 3];
        best = fminl(best, to_side(p, from, to));
        wide inward = wide_cross(normal, wide_sub(to, from));
        inside = inside && wide_dot(inward, wide_sub(p, from)) >= 0;
    }
    return inside ? fminl(best, fabsl(wide_dot(normal, wide_sub(p, corner[0]))) / area) : best;
}

double brute_triangle(vec3 p, const vec3 corners[3]) {
    return (double)to_triangle(p, corners);
}

double brute_distance(const struct mesh *mesh, vec3 p) {
    long double best = INFINITY;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 corner[3] = {mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1),
                          mesh_corner(mesh, t, 2)};
        best = fminl(best, to_triangle(p, corner));
    }
    return (double)best;
}

// ---- means ----

struct integrals {
    vec3 p, field, place; // of u; of x − p
    double weight, unit;  // weights are (unit/r)^power
    int power;
};

static void integrate(struct integrals *sums, const vec3 x[3], const vec3 u[3]) {
    vec3 edge = vec3_sub(x[1], x[0]), other = vec3_sub(x[2], x[0]);
    vec3 middle = vec3_scale(1.0 / 3, vec3_add(vec3_add(x[0], x[1]), x[2]));
    double size =
        fmax(vec3_length(vec3_sub(other, edge)), fmax(vec3_length(edge), vec3_length(other)));
    double off = vec3_distance(middle, sums->p);
    if (size > 0.03 * off) {
        vec3 mx[3], mu[3];
        for (int i = 0; i < 3; i++) {
            mx[i] = vec3_lerp(x[i], x[(i + 1) % 3], 0.5);
            mu[i] = vec3_lerp(u[i], u[(i + 1) % 3], 0.5);
        }
        for (int i = 0; i < 3; i++)
            integrate(sums, (vec3[3]){x[i], mx[i], mx[(i + 2) % 3]},
                      (vec3[3]){u[i], mu[i], mu[(i + 2) % 3]});
        integrate(sums, mx, mu);
        return;
    }
    double weight = 0.5 * vec3_length(vec3_cross(edge, other)) * pow(sums->unit / off, sums->power);
    vec3 field = vec3_scale(1.0 / 3, vec3_add(vec3_add(u[0], u[1]), u[2]));
    sums->weight += weight;
    sums->field = vec3_add_scaled(sums->field, weight, field);
    sums->place = vec3_add_scaled(sums->place, weight, vec3_sub(middle, sums->p));
}

static struct brute_mean integrate_all(const struct mesh *mesh, const float *displacement, vec3 p,
                                       int power) {
    struct integrals sums = {.p = p, .unit = brute_distance(mesh, p), .power = power};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 x[3], u[3];
        for (int i = 0; i < 3; i++) {
            const float *d = displacement + 3 * (size_t)mesh->triangles[3 * (size_t)t + (size_t)i];
            x[i] = mesh_corner(mesh, t, i);
            u[i] = (vec3){(double)d[0], (double)d[1], (double)d[2]};
        }
        integrate(&sums, x, u);
    }
    return (struct brute_mean){vec3_scale(1 / sums.weight, sums.field),
                               vec3_add(p, vec3_scale(1 / sums.weight, sums.place)),
                               sums.weight / pow(sums.unit, power)};
}

struct brute_mean brute_mean(const struct mesh *mesh, const float *displacement, vec3 p) {
    return integrate_all(mesh, displacement, p, 5);
}

struct brute_mean brute_integral(const struct mesh *mesh, const float *displacement, vec3 p) {
    return integrate_all(mesh, displacement, p, 4);
}
