#include "base/check.h"
#include "check/touch.h"

#include <stdlib.h>

// Of one surface and one cube. `least`: its signed distance at the cube's centre, or less.
struct overlap_side {
    double least;
    bool holds; // the cube lies inside
};

struct cube {
    vec3 centre;
    struct overlap_side a, b;
};

struct meeting {
    const struct touching *a, *b;
    pose T_a_b;
    struct touching_hints near_a, near_b;
    double side_mm; // of the cubes
    struct overlap found;
};

#define RADIUS 0.8660254037844386 // of a cube, over its side

static double distance_a(struct meeting *m, vec3 p, vec3 *out_point) {
    return touching_distance(m->a, p, &m->near_a, out_point);
}

static double distance_b(struct meeting *m, vec3 p, vec3 *out_point) {
    vec3 at = pose_apply_inverse(m->T_a_b, p);
    double distance = touching_distance(m->b, at, &m->near_b, out_point);
    *out_point = pose_apply(m->T_a_b, *out_point);
    return distance;
}

static void deepen(struct meeting *m, double depth, vec3 p) {
    if (depth > m->found.depth_mm) {
        m->found.depth_mm = depth;
        m->found.place = p;
    }
}

// At the places of both surfaces that are nearest to the cube's centre. A surface that a cube lies
// inside of is nearer to other cubes.
static void look_for_depth(struct meeting *m, const struct cube *cube, vec3 on_a, vec3 on_b) {
    vec3 unused;
    if (!cube->a.holds && fabs(cube->a.least) - cube->b.least > m->found.depth_mm)
        deepen(m, -distance_b(m, on_a, &unused), on_a);
    if (!cube->b.holds && fabs(cube->b.least) - cube->a.least > m->found.depth_mm)
        deepen(m, -distance_a(m, on_b, &unused), on_b);
}

static double share_inside(const struct overlap_side *side, double side_mm) {
    return side->holds ? 1 : fmin(fmax(0.5 - side->least / side_mm, 0), 1);
}

// Both surfaces count as facing planes.
static void add_volume(struct meeting *m, const struct cube *cube) {
    double share = share_inside(&cube->a, m->side_mm) + share_inside(&cube->b, m->side_mm) - 1;
    m->found.volume_mm3 += fmax(share, 0) * m->side_mm * m->side_mm * m->side_mm;
}

// False for a cube that lies outside of one, or inside both: no part of it tells more.
static bool look_into(struct meeting *m, struct cube *cube) {
    double radius = RADIUS * m->side_mm;
    vec3 on_a = {0}, on_b = {0};
    if (!cube->a.holds) {
        cube->a.least = distance_a(m, cube->centre, &on_a);
        cube->a.holds = cube->a.least <= -radius;
        if (cube->a.least >= radius)
            return false;
    }
    if (!cube->b.holds) {
        cube->b.least = distance_b(m, cube->centre, &on_b);
        cube->b.holds = cube->b.least <= -radius;
        if (cube->b.least >= radius)
            return false;
    }
    if (cube->a.holds && cube->b.holds) {
        add_volume(m, cube);
        return false;
    }
    look_for_depth(m, cube, on_a, on_b);
    return true;
}

static void divide(const struct cube *cube, double side_mm, struct cube out[8]) {
    for (int i = 0; i < 8; i++) {
        vec3 way = {i & 1 ? 0.25 : -0.25, i & 2 ? 0.25 : -0.25, i & 4 ? 0.25 : -0.25};
        out[i] = *cube;
        out[i].centre = vec3_add_scaled(cube->centre, side_mm, way);
        out[i].a.least -= RADIUS / 2 * side_mm;
        out[i].b.least -= RADIUS / 2 * side_mm;
    }
}

// All cubes of one size, then their parts.
static void look_at_cubes(struct meeting *m, vec3 centre) {
    size_t count = 1;
    struct cube *cubes = alloc(1, sizeof *cubes);
    cubes[0].centre = centre;
    for (;;) {
        size_t open = 0;
        for (size_t i = 0; i < count; i++)
            if (look_into(m, &cubes[i]))
                cubes[open++] = cubes[i];
        if (m->side_mm <= OVERLAP_LEAF_MM || 8 * open > OVERLAP_CUBES_MAX || open == 0) {
            for (size_t i = 0; i < open; i++)
                add_volume(m, &cubes[i]);
            free(cubes);
            return;
        }
        struct cube *parts = alloc(8 * open, sizeof *parts);
        for (size_t i = 0; i < open; i++)
            divide(&cubes[i], m->side_mm, parts + 8 * i);
        free(cubes);
        cubes = parts;
        count = 8 * open;
        m->side_mm /= 2;
    }
}

static struct box box_of_shell(const struct shell *shell, pose T) {
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    double around = shell->border ? BEHIND_SHEET_MM : 0;
    for (uint32_t v = 0; v < shell->mesh.vertex_count; v++) {
        vec3 p = pose_apply(T, mesh_vertex(&shell->mesh, v));
        box.min = (vec3){fmin(box.min.x, p.x - around), fmin(box.min.y, p.y - around),
                         fmin(box.min.z, p.z - around)};
        box.max = (vec3){fmax(box.max.x, p.x + around), fmax(box.max.y, p.y + around),
                         fmax(box.max.z, p.z + around)};
    }
    return box;
}

struct overlap overlap_of(const struct touching *a, const struct touching *b, pose T_a_b) {
    struct meeting meeting = {.a = a, .b = b, .T_a_b = T_a_b};
    if (!a->shell_count || !b->shell_count)
        return meeting.found;
    struct box of_a = box_of_shell(touching_surface(a), pose_identity());
    struct box of_b = box_of_shell(touching_surface(b), T_a_b);
    vec3 min = {fmax(of_a.min.x, of_b.min.x), fmax(of_a.min.y, of_b.min.y),
                fmax(of_a.min.z, of_b.min.z)};
    vec3 max = {fmin(of_a.max.x, of_b.max.x), fmin(of_a.max.y, of_b.max.y),
                fmin(of_a.max.z, of_b.max.z)};
    vec3 size = vec3_sub(max, min);
    if (size.x <= 0 || size.y <= 0 || size.z <= 0)
        return meeting.found;
    touching_forget(&meeting.near_a);
    touching_forget(&meeting.near_b);
    meeting.side_mm = fmax(size.x, fmax(size.y, size.z));
    look_at_cubes(&meeting, vec3_lerp(min, max, 0.5));
    if (meeting.found.depth_mm <= 0)
        meeting.found.volume_mm3 = 0;
    return meeting.found;
}
