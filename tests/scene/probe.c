#include "scene/probe.h"

#define REACH_MM 15.0
#define TOUCH_MM 1e-6
#define BISECTIONS 40

pose probe_aim(vec3 portal, vec3 direction, double depth_mm) {
    vec3 up = {0, 0, 1}, z = vec3_unit_or(direction, up);
    vec3 x = vec3_unit_or(vec3_cross(z, (vec3){0.3, 0.1, 1}), (vec3){1, 0, 0});
    vec3 y = vec3_cross(z, x);
    mat3 R = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
    return (pose){quat_unit(quat_from_mat3(R)), vec3_add_scaled(portal, depth_mm, z)};
}

static double signed_distance(const struct mesh *mesh, const struct closest *c, vec3 p) {
    vec3 a = mesh_corner(mesh, c->triangle, 0);
    vec3 e1 = vec3_sub(mesh_corner(mesh, c->triangle, 1), a);
    vec3 e2 = vec3_sub(mesh_corner(mesh, c->triangle, 2), a);
    bool outside = vec3_dot(vec3_sub(p, c->point), vec3_cross(e1, e2)) >= 0;
    return outside ? c->distance : -c->distance;
}

double bodies_gap(const struct bodies *bodies, vec3 p) {
    double least = INFINITY;
    for (int k = 0; k < bodies->count; k++) {
        struct closest c;
        if (query_closest(bodies->queries[k], p, REACH_MM, MESH_NONE, &c))
            least = fmin(least, signed_distance(&bodies->meshes[k], &c, p));
    }
    return least;
}

// The least gap of the shaft, and where along z.
static double shaft_gap(const struct bodies *bodies, pose T, double *out_z) {
    double least = INFINITY;
    for (double z = 0; z > -PROBE_LENGTH_MM && least > -0.5;) {
        double gap = bodies_gap(bodies, pose_apply(T, (vec3){0, 0, z}));
        if (gap < least) {
            least = gap;
            *out_z = z;
        }
        z -= gap > 2 ? 0.5 * fmin(gap, REACH_MM) : 0.5;
    }
    return least;
}

struct swing {
    vec3 portal, direction, aside;
    double depth;
};

static pose swing_at(const struct swing *s, double angle, double further) {
    return probe_aim(s->portal, vec3_add_scaled(s->direction, angle, s->aside), s->depth + further);
}

// Where the gap of the shaft, or of the tip alone, falls to 0 between `from` and `to`.
static double last_clear(const struct bodies *knee, const struct swing *s, bool slide, double angle,
                         double from, double to) {
    for (int i = 0; i < BISECTIONS; i++) {
        double middle = 0.5 * (from + to), z;
        pose T = slide ? swing_at(s, angle, middle) : swing_at(s, middle, 0);
        double gap = slide ? bodies_gap(knee, T.translation) : shaft_gap(knee, T, &z);
        *(gap < 0 ? &to : &from) = middle;
    }
    return from;
}

static struct swing swing_in_knee(const struct bodies *knee, struct random *r) {
    struct swing s;
    double z;
    do {
        s.portal = (vec3){random_bits(r) & 1 ? 28 : -28, 50, random_between(r, 0, 14)};
        double x = random_between(r, -25, 25), y = random_between(r, -15, 25);
        vec3 way = vec3_sub((vec3){x, y, random_between(r, -1, 3)}, s.portal);
        s.depth = vec3_length(way) + random_between(r, -10, 15);
        s.direction = vec3_unit_or(way, way);
        vec3 any = random_direction(r);
        any = vec3_add_scaled(any, -vec3_dot(any, s.direction), s.direction);
        s.aside = vec3_unit_or(any, any);
    } while (shaft_gap(knee, swing_at(&s, 0, 0), &z) < 0.2);
    return s;
}

struct probe probe_in_knee(const struct bodies *knee, struct random *r) {
    struct swing s = swing_in_knee(knee, r);
    return (struct probe){s.portal, swing_at(&s, 0, 0)};
}

// False where it does not come to touch by a turn of 0.4.
static bool turn_to_touch(const struct bodies *knee, const struct swing *s, double *out_angle) {
    double z;
    for (double angle = 0.01; angle < 0.4; angle += 0.01)
        if (shaft_gap(knee, swing_at(s, angle, 0), &z) < 0) {
            *out_angle = last_clear(knee, s, false, 0, angle - 0.01, angle);
            return true;
        }
    return false;
}

// Along the line that the shaft is on, which goes on touching. The same.
static bool slide_to_touch(const struct bodies *knee, const struct swing *s, double angle,
                           double *out_further) {
    for (double further = 0.5; further < 25; further += 0.25)
        if (bodies_gap(knee, swing_at(s, angle, further).translation) < 0) {
            *out_further = last_clear(knee, s, true, angle, further - 0.25, further);
            return *out_further > 0.5;
        }
    return false;
}

struct probe probe_in_touch(const struct bodies *knee, struct random *r,
                            enum probe_touch *out_touch) {
    for (;;) {
        struct swing s = swing_in_knee(knee, r);
        double angle, further = 0, z = 0;
        if (!turn_to_touch(knee, &s, &angle))
            continue;
        pose T = swing_at(&s, angle, 0);
        if (shaft_gap(knee, T, &z) > TOUCH_MM)
            continue;
        *out_touch = z > -1 ? PROBE_TIP : PROBE_SHAFT;
        if (*out_touch == PROBE_SHAFT && random_bits(r) % 2 &&
            slide_to_touch(knee, &s, angle, &further))
            *out_touch = PROBE_BOTH;
        return (struct probe){s.portal, swing_at(&s, angle, further)};
    }
}

void bodies_displaced(struct bodies *out, const struct bodies *bodies) {
    *out = (struct bodies){0};
    for (int k = 0; k < bodies->count; k++) {
        struct mesh mesh;
        mesh_copy(&mesh, &bodies->meshes[k]);
        for (size_t i = 0; i < 3 * (size_t)mesh.vertex_count; i++)
            mesh.positions[i] += bodies->displacements[k][i];
        bodies_add(out, &mesh, NULL, bodies->surfaces[k].body);
    }
}
