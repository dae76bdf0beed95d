#include "cutting/bites.h"

#include "base/check.h"

#include <math.h>

// ---- single blades ------------------------------------------------------------------------------

static void create(const struct plane *planes, int count, struct convex *out) {
    struct error err;
    CHECK(convex_create(planes, count, out, &err) == RESULT_OK);
}

static int box_planes(pose T, vec3 half, struct plane *out) {
    const vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const double halves[3] = {half.x, half.y, half.z};
    for (int i = 0; i < 3; i++) {
        vec3 axis = quat_rotate(T.rotation, axes[i]);
        double middle = vec3_dot(axis, T.translation);
        out[2 * i] = (struct plane){axis, middle + halves[i]};
        out[2 * i + 1] = (struct plane){vec3_scale(-1, axis), halves[i] - middle};
    }
    return 6;
}

void convex_box(pose T_mesh_box, vec3 half, struct convex *out) {
    struct plane planes[6];
    create(planes, box_planes(T_mesh_box, half, planes), out);
}

void convex_random(struct random *random, vec3 centre, double radius, struct convex *out) {
    struct plane planes[CONVEX_PLANES_MAX];
    pose T = {random_pose(random, 0).rotation, centre};
    int count = box_planes(T, (vec3){radius, radius, radius}, planes);
    int more = (int)random_between(random, 2, 54);
    for (int i = 0; i < more; i++) {
        vec3 normal = random_direction(random);
        double distance = radius * random_between(random, 0.75, 1.1);
        planes[count++] = (struct plane){normal, vec3_dot(normal, centre) + distance};
    }
    create(planes, count, out);
}

void convex_move(const struct convex *convex, pose T_to_from, struct convex *out) {
    struct plane planes[CONVEX_PLANES_MAX];
    for (int i = 0; i < convex->plane_count; i++) {
        vec3 normal = quat_rotate(T_to_from.rotation, convex->planes[i].normal);
        planes[i].normal = normal;
        planes[i].offset = convex->planes[i].offset + vec3_dot(normal, T_to_from.translation);
    }
    create(planes, convex->plane_count, out);
}

// ---- places on a mesh ---------------------------------------------------------------------------

static uint32_t random_triangle(struct random *random, const struct cut_mesh *mesh) {
    for (;;) {
        uint32_t t = (uint32_t)(random_bits(random) % cut_mesh_triangle_bound(mesh));
        if (cut_mesh_triangle_alive(mesh, t))
            return t;
    }
}

static vec3 corner(const struct cut_mesh *mesh, uint32_t triangle, int i) {
    return cut_mesh_vertex(mesh, cut_mesh_triangle(mesh, triangle)[i]);
}

// A point of the surface and its normal. The largest of a few triangles, so that the many small
// ones where cuts were made do not draw all others.
static vec3 random_place(struct random *random, const struct cut_mesh *mesh, vec3 *out_normal) {
    vec3 place = {0}, largest = {0};
    for (int i = 0; i < 6; i++) {
        uint32_t t = random_triangle(random, mesh);
        vec3 a = corner(mesh, t, 0), b = corner(mesh, t, 1), c = corner(mesh, t, 2);
        vec3 area = vec3_cross(vec3_sub(b, a), vec3_sub(c, a));
        if (i == 0 || vec3_length(area) > vec3_length(largest)) {
            place = vec3_lerp(vec3_lerp(a, b, random_between(random, 0, 1)), c,
                              random_between(random, 0, 1));
            largest = area;
        }
    }
    *out_normal = vec3_unit_or(largest, (vec3){0, 0, 1});
    return place;
}

static vec3 farthest_vertex(const struct cut_mesh *mesh, vec3 direction) {
    vec3 farthest = {0};
    double most = -INFINITY;
    for (uint32_t v = 0; v < cut_mesh_vertex_bound(mesh); v++) {
        if (!cut_mesh_vertex_alive(mesh, v))
            continue;
        vec3 p = cut_mesh_vertex(mesh, v);
        double distance = vec3_dot(direction, p);
        if (distance > most)
            farthest = p;
        most = fmax(most, distance);
    }
    return farthest;
}

static quat turn_z_to(vec3 direction) {
    vec3 axis = vec3_cross((vec3){0, 0, 1}, direction);
    double angle = atan2(vec3_length(axis), direction.z);
    return quat_from_axis_angle(vec3_unit_or(axis, (vec3){1, 0, 0}), angle);
}

// ---- the kinds ----------------------------------------------------------------------------------

static void nibble(struct biter *biter, const struct cut_mesh *mesh) {
    struct random *r = &biter->random;
    struct bite *bite = &biter->last;
    vec3 normal, step = vec3_scale(random_between(r, 0.2, 0.9), random_direction(r));
    vec3 centre = random_place(r, mesh, &normal);
    if (bite->part_count && random_bits(r) % 3 == 0) { // a surgeon goes on where he was
        struct box box = bite->parts[0].box;
        centre = vec3_add_scaled(vec3_lerp(box.min, box.max, 0.5), 0.7, random_direction(r));
    }
    centre = vec3_add_scaled(centre, random_between(r, -0.4, 0.6), normal);
    bite->part_count = random_bits(r) % 8 ? 1 : 2 + (int)(random_bits(r) % 3);
    for (int i = 0; i < bite->part_count; i++) {
        vec3 at = vec3_add_scaled(centre, i, step);
        vec3 half = {random_between(r, 0.2, 1.4), random_between(r, 0.2, 1.4),
                     random_between(r, 0.2, 1.4)};
        if (random_bits(r) % 2)
            convex_box((pose){random_pose(r, 0).rotation, at}, half, &bite->parts[i]);
        else
            convex_random(r, at, half.x, &bite->parts[i]);
    }
}

static double tiny(struct random *r) {
    return pow(10, random_between(r, -10, -3));
}

// A vector along one of the faces: moved by it, the part lies flush in that face's plane.
static vec3 along_a_face(struct random *r, const struct convex *convex) {
    const struct plane *plane = &convex->planes[random_bits(r) % (unsigned)convex->plane_count];
    vec3 size = vec3_sub(convex->box.max, convex->box.min);
    vec3 along = vec3_unit_or(vec3_cross(plane->normal, random_direction(r)), (vec3){0});
    return vec3_scale(random_between(r, 0.2, 0.6) * vec3_length(size), along);
}

static void nearly_the_last(struct biter *biter) {
    struct random *r = &biter->random;
    struct bite *bite = &biter->last;
    pose T = pose_identity();
    vec3 centre = vec3_lerp(bite->parts[0].box.min, bite->parts[0].box.max, 0.5);
    switch (random_bits(r) % 4) {
    case 0:
        return;
    case 1:
        T.translation = vec3_scale(tiny(r), random_direction(r));
        break;
    case 2:
        T.translation = along_a_face(r, &bite->parts[0]);
        break;
    default:
        T.rotation = quat_from_axis_angle(random_direction(r), tiny(r));
        T.translation = vec3_sub(centre, quat_rotate(T.rotation, centre));
    }
    for (int i = 0; i < bite->part_count; i++) {
        struct convex from = bite->parts[i];
        convex_move(&from, T, &bite->parts[i]);
    }
}

static void go_through(struct biter *biter, const struct cut_mesh *mesh) {
    struct random *r = &biter->random;
    vec3 normal, place = random_place(r, mesh, &normal);
    vec3 direction = vec3_unit_or(vec3_add_scaled(normal, 0.5, random_direction(r)), normal);
    vec3 half = {random_between(r, 0.2, 0.6), random_between(r, 0.2, 0.6), 15};
    pose T = {turn_z_to(direction), place};
    biter->last.part_count = 1;
    convex_box(T, half, &biter->last.parts[0]);
}

static void split(struct biter *biter, const struct cut_mesh *mesh) {
    struct random *r = &biter->random;
    vec3 direction = random_direction(r), tip = farthest_vertex(mesh, direction);
    double depth = random_between(r, 0.6, 1.5), half_kerf = random_between(r, 0.05, 0.2);
    pose T = {turn_z_to(direction), vec3_add_scaled(tip, -depth, direction)};
    biter->last.part_count = 1;
    convex_box(T, (vec3){14, 14, half_kerf}, &biter->last.parts[0]);
}

void biter_init(struct biter *biter, uint64_t seed) {
    *biter = (struct biter){.random = {seed}};
}

void biter_next(struct biter *biter, const struct cut_mesh *mesh) {
    double die = random_between(&biter->random, 0, 100);
    biter->kind = die < 78   ? BITE_NIBBLE
                  : die < 92 ? BITE_NEARLY
                  : die < 97 ? BITE_THROUGH
                             : BITE_SPLIT;
    if (biter->kind == BITE_NEARLY && biter->last.part_count)
        nearly_the_last(biter);
    else if (biter->kind == BITE_THROUGH)
        go_through(biter, mesh);
    else if (biter->kind == BITE_SPLIT)
        split(biter, mesh);
    else
        nibble(biter, mesh);
}
