#include "warp/warp.h"

#include "random.h"
#include "scene/bodies.h"
#include "test.h"

#include <string.h>

// Five surfaces on three bodies, each somewhere near its place, each corrected a little.
struct world {
    struct bodies bodies;
    pose B[3], M[3];
    struct warp_scene scene;
};

static pose small_pose(struct random *r, double angle_rad, double length_mm) {
    quat q = quat_from_axis_angle(random_direction(r), angle_rad);
    return (pose){q, vec3_scale(length_mm, random_direction(r))};
}

static void place(struct world *w, struct random *r, bool corrected) {
    for (int i = 0; i < 3; i++) {
        w->B[i] = small_pose(r, 0.2, 2);
        w->M[i] = small_pose(r, 0.1, 1);
    }
    w->scene.T_world_body = w->B;
    w->scene.correction = corrected ? w->M : NULL;
}

static void world_create(struct world *w, struct random *r, bool corrected) {
    bodies_knee(&w->bodies, 8);
    w->scene =
        (struct warp_scene){.surfaces = w->bodies.surfaces, .surface_count = w->bodies.count};
    place(w, r, corrected);
}

static vec3 somewhere(struct random *r) {
    return bodies_knee_path(random_between(r, 0, 3000));
}

static struct warp warp_at(const struct warp_scene *scene, const struct field *field, vec3 y) {
    struct warp_memory memory;
    struct warp warp;
    warp_memory_init(&memory);
    warp_point(scene, field, y, &memory, &warp);
    return warp;
}

static struct closest contact_at(const struct warp_scene *scene, int surface, vec3 y) {
    struct closest c;
    vec3 p = pose_apply_inverse(scene->T_world_body[scene->surfaces[surface].body], y);
    assert_true(query_closest(scene->surfaces[surface].query, p, INFINITY, MESH_NONE, &c));
    return c;
}

static bool equal(vec3 a, vec3 b) {
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

static void assert_mat3_near(mat3 a, mat3 b, double tolerance) {
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            assert_near(a.m[row][column], b.m[row][column], tolerance);
}

static vec3 point_on(const struct world *w, int surface, struct random *r) {
    const struct mesh *mesh = w->scene.surfaces[surface].mesh;
    uint32_t t = (uint32_t)(random_bits(r) % mesh->triangle_count);
    double u = random_between(r, 0, 1), v = random_between(r, 0, 1 - u);
    vec3 x = vec3_add_scaled(
        vec3_add_scaled(vec3_scale(1 - u - v, mesh_corner(mesh, t, 0)), u, mesh_corner(mesh, t, 1)),
        v, mesh_corner(mesh, t, 2));
    return pose_apply(w->B[w->scene.surfaces[surface].body], x);
}

static double clearance(const struct world *w, int surface, vec3 y) {
    double nearest = INFINITY;
    for (int i = 0; i < w->scene.surface_count; i++)
        if (i != surface)
            nearest = fmin(nearest, contact_at(&w->scene, i, y).distance);
    return nearest;
}

// ---- the formula of the header, written down once more: every triangle, matrices, Eq. 3 as
// printed ----

static vec3 oracle_delta(const struct warp_scene *scene, int index, vec3 y, double *out_distance) {
    const struct warp_surface *surface = &scene->surfaces[index];
    pose B = scene->T_world_body[surface->body];
    pose M = scene->correction ? scene->correction[surface->body] : pose_identity();
    mat3 R = quat_to_mat3(B.rotation), MR = quat_to_mat3(M.rotation);
    vec3 p = mat3_apply_transposed(R, vec3_sub(y, B.translation));
    struct closest best = {.distance = INFINITY}, c;
    for (uint32_t t = 0; t < surface->mesh->triangle_count; t++) {
        closest_on_triangle(surface->mesh, t, p, &c);
        if (c.distance < best.distance)
            best = c;
    }
    vec3 target = best.point;
    for (int i = 0; i < 3 && surface->displacement; i++) {
        const float *d =
            surface->displacement + 3 * surface->mesh->triangles[3 * best.triangle + (unsigned)i];
        target = vec3_add_scaled(target, best.weights[i],
                                 (vec3){(double)d[0], (double)d[1], (double)d[2]});
    }
    *out_distance = best.distance;
    vec3 virtual_point = vec3_add(mat3_apply(R, target), B.translation);
    vec3 physical_point = vec3_add(mat3_apply(R, best.point), B.translation);
    return vec3_sub(vec3_add(mat3_apply(MR, virtual_point), M.translation), physical_point);
}

static vec3 oracle_warp(const struct warp_scene *scene, const struct field *field, vec3 y) {
    double distance[WARP_SURFACES_MAX], nearest = INFINITY;
    vec3 delta[WARP_SURFACES_MAX], sum = {0};
    for (int i = 0; i < scene->surface_count; i++) {
        delta[i] = oracle_delta(scene, i, y, &distance[i]);
        nearest = fmin(nearest, distance[i]);
    }
    bool gaussian = field->kind == FIELD_GAUSSIAN;
    double total = gaussian ? 0 : field->background_per_mm, R = field->radius_mm;
    for (int i = 0; i < scene->surface_count; i++) {
        double d = distance[i], unit = field->unit_mm;
        double weight = gaussian ? exp(-(d / unit) * (d / unit) / (2 * nearest / unit))
                                 : fmax(R - d, 0) / (R * d);
        sum = vec3_add_scaled(sum, weight, delta[i]);
        total += weight;
    }
    return vec3_scale(1 / total, sum);
}

static void the_warp_is_its_formula(void **state) {
    (void)state;
    struct random r = {1};
    struct world w;
    world_create(&w, &r, true);
    for (int i = 0; i < 200; i++) {
        place(&w, &r, i % 2);
        double off = pow(10, random_between(&r, -5.9, 0));
        vec3 near = vec3_add_scaled(point_on(&w, i % 5, &r), off, random_direction(&r));
        vec3 y = i % 3 ? somewhere(&r) : near;
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct field field = field_default((enum field_kind)kind);
            struct warp warp = warp_at(&w.scene, &field, y);
            assert_vec3_near(warp.displacement, oracle_warp(&w.scene, &field, y),
                             i % 3 ? 1e-10 : 1e-5); // what touching leaves out
        }
    }
    bodies_fini(&w.bodies);
}

// ---- on the surfaces ----

static void on_a_surface_the_warp_is_its_own_displacement_exactly(void **state) {
    (void)state;
    struct random r = {2};
    struct world w;
    world_create(&w, &r, true);
    int touched = 0;
    for (int i = 0; i < 1000; i++) {
        place(&w, &r, i % 2);
        int surface = i % w.scene.surface_count;
        vec3 y = point_on(&w, surface, &r);
        if (clearance(&w, surface, y) < 1e-3)
            continue;
        struct closest c = contact_at(&w.scene, surface, y);
        vec3 delta = warp_of_contact(&w.scene, surface, &c);
        double distance;
        assert_vec3_near(delta, oracle_delta(&w.scene, surface, y, &distance), 1e-11);
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct field field = field_default((enum field_kind)kind);
            struct warp warp = warp_at(&w.scene, &field, y);
            assert_true(equal(warp.displacement, delta));
            assert_int_equal(warp.nearest, surface);
            assert_true(warp.nearest_mm == c.distance);
        }
        touched++;
    }
    assert_true(touched > 500);
    bodies_fini(&w.bodies);
}

static void where_two_surfaces_touch_the_warp_is_their_mean(void **state) {
    (void)state;
    struct random r = {3};
    struct bodies walls;
    bodies_walls(&walls, 0, 3);
    pose B = pose_identity();
    struct warp_scene scene = {walls.surfaces, walls.count, &B, NULL};
    for (int i = 0; i < 100; i++) {
        vec3 y = random_in_box(&r, 25);
        y.z = i % 2 ? 0 : random_between(&r, -9e-7, 9e-7);
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct field field = field_default((enum field_kind)kind);
            assert_vec3_near(warp_at(&scene, &field, y).displacement, ((vec3){0, 0, 1.5}), 1e-14);
        }
    }
    bodies_fini(&walls);
}

// The nearer, the closer to Δ, down to a nanometre: no step where "touching" begins.
static void the_warp_is_continuous_towards_a_surface(void **state) {
    (void)state;
    struct random r = {4};
    struct world w;
    world_create(&w, &r, true);
    for (int i = 0; i < 300; i++) {
        int surface = i % w.scene.surface_count;
        vec3 y = point_on(&w, surface, &r), away = random_direction(&r);
        if (clearance(&w, surface, y) < 0.5)
            continue;
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct field field = field_default((enum field_kind)kind);
            vec3 delta = warp_at(&w.scene, &field, y).displacement;
            for (double h = kind == FIELD_GAUSSIAN ? 1e-4 : 0.1; h > 1e-10; h *= 0.5) {
                struct warp near = warp_at(&w.scene, &field, vec3_add_scaled(y, h, away));
                assert_true(vec3_distance(near.displacement, delta) < 200 * h);
            }
        }
    }
    bodies_fini(&w.bodies);
}

static void nothing_displaced_and_nothing_corrected_warps_nothing(void **state) {
    (void)state;
    struct random r = {5};
    struct world w;
    world_create(&w, &r, false);
    struct warp_surface plain[BODIES_MAX];
    memcpy(plain, w.bodies.surfaces, sizeof plain);
    for (int i = 0; i < w.bodies.count; i++)
        plain[i].displacement = NULL;
    w.scene.surfaces = plain;
    for (int i = 0; i < 200; i++) {
        struct field field = field_default(i % 2 ? FIELD_GAUSSIAN : FIELD_INVERSE_DISTANCE);
        struct warp warp = warp_at(&w.scene, &field, somewhere(&r));
        assert_true(equal(warp.displacement, (vec3){0, 0, 0}));
        assert_mat3_near(warp.gradient, (mat3){0}, 1e-15);
    }
    bodies_fini(&w.bodies);
}

// ---- reach ----

static void beyond_the_radius_there_is_no_warp(void **state) {
    (void)state;
    struct random r = {6};
    struct bodies walls;
    bodies_walls(&walls, 2, 3);
    pose B = pose_identity(), M = small_pose(&r, 0.1, 1);
    struct warp_scene scene = {walls.surfaces, walls.count, &B, &M};
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    double before = INFINITY;
    for (double gap = 0.1; gap < 12; gap += 0.1) {
        struct warp warp = warp_at(&scene, &field, (vec3){1, 2, -1 - gap});
        assert_int_equal(warp.nearest, 0);
        double length = vec3_length(warp.displacement);
        assert_true(length < before);
        before = length;
    }
    struct warp rim = warp_at(&scene, &field, (vec3){1, 2, -13 + 1e-9});
    assert_true(vec3_length(rim.displacement) < 1e-8);
    for (int i = 0; i < 100; i++) {
        vec3 y = {random_between(&r, -9, 9), random_between(&r, -9, 9), -13 - 1e-9 - i};
        struct warp warp = warp_at(&scene, &field, y);
        assert_true(equal(warp.displacement, (vec3){0, 0, 0}));
        assert_mat3_near(warp.gradient, (mat3){0}, 0);
        assert_int_equal(warp.nearest, -1);
        assert_true(warp.nearest_mm == INFINITY && warp.trust_radius_mm == 2);
    }
    bodies_fini(&walls);
}

static void the_nearest_two_surfaces_set_the_trust_radius(void **state) {
    (void)state;
    struct random r = {7};
    struct world w;
    world_create(&w, &r, true);
    for (int i = 0; i < 300; i++) {
        vec3 y = i % 3 ? somewhere(&r) : point_on(&w, i % w.scene.surface_count, &r);
        struct field field = field_default(i % 2 ? FIELD_GAUSSIAN : FIELD_INVERSE_DISTANCE);
        double first = INFINITY, second = INFINITY;
        for (int k = 0; k < w.scene.surface_count; k++) {
            double d = contact_at(&w.scene, k, y).distance;
            second = fmin(second, fmax(d, first));
            first = fmin(first, d);
        }
        struct warp warp = warp_at(&w.scene, &field, y);
        assert_near(warp.trust_radius_mm, fmin(fmax(first + second, 0.5), 2), 1e-15);
        if (warp.nearest >= 0)
            assert_true(warp.nearest_mm == first);
    }
    bodies_fini(&w.bodies);
}

// ---- the derivative ----

// All surfaces keep their closest feature around y, so that W is smooth there. Counts the features
// of those in reach.
static bool features_stay(const struct warp_scene *scene, vec3 y, double h, double reach,
                          int *counts) {
    int seen[3] = {0};
    for (int k = 0; k < scene->surface_count; k++) {
        struct closest c = contact_at(scene, k, y);
        if (c.distance < 0.3 || fabs(c.distance - reach) < 4 * h)
            return false;
        seen[c.feature] += c.distance < reach;
        for (int i = 0; i < 27; i++) {
            vec3 step = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
            struct closest near = contact_at(scene, k, vec3_add_scaled(y, 2 * h, step));
            if (near.triangle != c.triangle || near.feature != c.feature || near.corner != c.corner)
                return false;
        }
    }
    for (int i = 0; i < 3; i++)
        counts[i] += seen[i];
    return true;
}

static vec3 difference(const struct warp_scene *scene, const struct field *field, vec3 y,
                       vec3 step) {
    vec3 ahead = warp_at(scene, field, vec3_add(y, step)).displacement;
    return vec3_sub(ahead, warp_at(scene, field, vec3_sub(y, step)).displacement);
}

// Central differences of fourth order.
static mat3 differences(const struct warp_scene *scene, const struct field *field, vec3 y,
                        double h) {
    mat3 out;
    for (int axis = 0; axis < 3; axis++) {
        vec3 step = {h * (axis == 0), h * (axis == 1), h * (axis == 2)};
        vec3 one = difference(scene, field, y, step);
        vec3 two = difference(scene, field, y, vec3_scale(2, step));
        vec3 slope = vec3_scale(1 / (12 * h), vec3_sub(vec3_scale(8, one), two));
        out.m[0][axis] = slope.x;
        out.m[1][axis] = slope.y;
        out.m[2][axis] = slope.z;
    }
    return out;
}

static void the_gradient_agrees_with_central_differences(void **state) {
    (void)state;
    struct random r = {8};
    struct world w;
    world_create(&w, &r, true);
    const double h = 1e-3;
    for (int kind = 0; kind < FIELD_COUNT; kind++) {
        struct field field = field_default((enum field_kind)kind);
        int counts[3] = {0};
        for (int i = 0; i < 1500; i++) {
            place(&w, &r, i % 2);
            vec3 y = somewhere(&r);
            double reach = kind == FIELD_GAUSSIAN ? INFINITY : field.radius_mm;
            if (!features_stay(&w.scene, y, h, reach, counts))
                continue;
            mat3 gradient = warp_at(&w.scene, &field, y).gradient;
            assert_mat3_near(gradient, differences(&w.scene, &field, y, h),
                             1e-7 * (1 + mat3_norm(gradient)));
        }
        for (int feature = 0; feature < 3; feature++)
            assert_true(counts[feature] > 30);
    }
    bodies_fini(&w.bodies);
}

// On a surface the gradient is that of its own displacement, along the surface.
static void on_a_surface_the_gradient_holds_along_it(void **state) {
    (void)state;
    struct random r = {9};
    struct world w;
    world_create(&w, &r, true);
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    for (int i = 0; i < 500; i++) {
        place(&w, &r, i % 2);
        int surface = i % w.scene.surface_count;
        vec3 y = point_on(&w, surface, &r);
        struct closest c = contact_at(&w.scene, surface, y);
        double inside = fmin(c.weights[0], fmin(c.weights[1], c.weights[2]));
        if (c.feature != FEATURE_FACE || inside < 0.01 || clearance(&w, surface, y) < 1)
            continue;
        const struct mesh *mesh = w.scene.surfaces[surface].mesh;
        vec3 side = vec3_sub(mesh_corner(mesh, c.triangle, 1), mesh_corner(mesh, c.triangle, 0));
        quat turn = w.B[w.scene.surfaces[surface].body].rotation;
        vec3 step = quat_rotate(turn, vec3_scale(1e-3, side));
        struct warp warp = warp_at(&w.scene, &field, y);
        vec3 moved = warp_at(&w.scene, &field, vec3_add(y, step)).displacement;
        vec3 told = vec3_add(warp.displacement, mat3_apply(warp.gradient, step));
        assert_vec3_near(moved, told, 1e-11);
    }
    bodies_fini(&w.bodies);
}

// ---- what must not matter ----

static void memory_never_changes_a_bit(void **state) {
    (void)state;
    struct random r = {10};
    struct world w;
    world_create(&w, &r, true);
    struct warp_memory kept, wild;
    warp_memory_init(&kept);
    for (int i = 0; i < 2000; i++) {
        struct field field = field_default(i % 2 ? FIELD_GAUSSIAN : FIELD_INVERSE_DISTANCE);
        vec3 y = i % 7 ? bodies_knee_path(0.05 * i) : somewhere(&r);
        struct warp fresh = warp_at(&w.scene, &field, y), warp;
        warp_point(&w.scene, &field, y, &kept, &warp);
        assert_memory_equal(&warp.displacement, &fresh.displacement, sizeof(vec3));
        assert_memory_equal(&warp.gradient, &fresh.gradient, sizeof(mat3));
        for (int k = 0; k < WARP_SURFACES_MAX; k++) {
            wild.triangle[k] = (uint32_t)(random_bits(&r) % 700);
        }
        warp_point(&w.scene, &field, y, &wild, &warp);
        assert_memory_equal(&warp.displacement, &fresh.displacement, sizeof(vec3));
        assert_memory_equal(&warp.gradient, &fresh.gradient, sizeof(mat3));
        assert_true(warp.nearest == fresh.nearest && warp.nearest_mm == fresh.nearest_mm);
        assert_true(warp.trust_radius_mm == fresh.trust_radius_mm);
    }
    bodies_fini(&w.bodies);
}

// Poses of the whole room: W and its gradient turn with it.
static void the_place_of_the_room_does_not_matter(void **state) {
    (void)state;
    struct random r = {11};
    struct world w;
    world_create(&w, &r, true);
    for (int i = 0; i < 200; i++) {
        place(&w, &r, true);
        struct field field = field_default(i % 2 ? FIELD_GAUSSIAN : FIELD_INVERSE_DISTANCE);
        vec3 y = somewhere(&r);
        struct warp here = warp_at(&w.scene, &field, y);
        pose T = random_pose(&r, 300);
        for (int k = 0; k < 3; k++) {
            w.B[k] = pose_compose(T, w.B[k]);
            w.M[k] = pose_compose(T, pose_compose(w.M[k], pose_inverse(T)));
        }
        struct warp there = warp_at(&w.scene, &field, pose_apply(T, y));
        mat3 R = quat_to_mat3(T.rotation);
        assert_vec3_near(there.displacement, mat3_apply(R, here.displacement), 1e-9);
        assert_mat3_near(there.gradient,
                         mat3_multiply(R, mat3_multiply(here.gradient, mat3_transpose(R))), 1e-8);
    }
    bodies_fini(&w.bodies);
}

// The same surfaces eight times as large (which floats hold exactly), on one body at rest.
static void enlarge(struct bodies *out, const struct bodies *from) {
    *out = (struct bodies){0};
    for (int i = 0; i < from->count; i++) {
        struct mesh mesh;
        mesh_copy(&mesh, &from->meshes[i]);
        shape_scale(&mesh, 8);
        float *displacement = shape_displacement(&mesh, 0, 0);
        for (size_t k = 0; k < 3 * (size_t)mesh.vertex_count; k++)
            displacement[k] = 8 * from->displacements[i][k];
        bodies_add(out, &mesh, displacement, 0);
    }
}

static void the_unit_of_length_matters_to_the_gaussian_alone(void **state) {
    (void)state;
    struct random r = {12};
    struct world w;
    struct bodies large;
    world_create(&w, &r, false);
    for (int k = 0; k < 3; k++)
        w.B[k] = pose_identity();
    enlarge(&large, &w.bodies);
    struct warp_scene scene = {large.surfaces, large.count, w.B, NULL};
    struct field inverse = field_default(FIELD_INVERSE_DISTANCE), inverse_large = inverse;
    inverse_large.radius_mm *= 8;
    inverse_large.background_per_mm /= 8;
    struct field gaussian = field_default(FIELD_GAUSSIAN), gaussian_mm = gaussian;
    gaussian_mm.unit_mm = 1;
    double largest = 0, largest_mm = 0;
    for (int i = 0; i < 200; i++) {
        vec3 y = somewhere(&r), y8 = vec3_scale(8, y);
        struct warp a = warp_at(&w.scene, &inverse, y);
        struct warp b = warp_at(&scene, &inverse_large, y8);
        assert_vec3_near(vec3_scale(0.125, b.displacement), a.displacement, 1e-12);
        assert_mat3_near(a.gradient, b.gradient, 1e-11);
        struct warp cm = warp_at(&w.scene, &gaussian, y);
        struct warp mm = warp_at(&w.scene, &gaussian_mm, y);
        struct warp cm8 = warp_at(&scene, &gaussian, y8);
        largest =
            fmax(largest, vec3_distance(vec3_scale(0.125, cm8.displacement), cm.displacement));
        largest_mm = fmax(largest_mm, vec3_distance(mm.displacement, cm.displacement));
    }
    assert_true(largest > 0.1 && largest_mm > 0.1);
    bodies_fini(&large);
    bodies_fini(&w.bodies);
}

static void fields_are_found_by_name(void **state) {
    (void)state;
    for (int kind = 0; kind < FIELD_COUNT; kind++) {
        enum field_kind found = FIELD_COUNT;
        assert_true(field_from_name(field_name((enum field_kind)kind), &found));
        assert_int_equal(found, kind);
        assert_int_equal(field_default(found).kind, kind);
    }
    enum field_kind untouched = FIELD_GAUSSIAN;
    assert_false(field_from_name("inverse_distance", &untouched));
    assert_false(field_from_name("", &untouched));
    assert_int_equal(untouched, FIELD_GAUSSIAN);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_warp_is_its_formula),
        cmocka_unit_test(on_a_surface_the_warp_is_its_own_displacement_exactly),
        cmocka_unit_test(where_two_surfaces_touch_the_warp_is_their_mean),
        cmocka_unit_test(the_warp_is_continuous_towards_a_surface),
        cmocka_unit_test(nothing_displaced_and_nothing_corrected_warps_nothing),
        cmocka_unit_test(beyond_the_radius_there_is_no_warp),
        cmocka_unit_test(the_nearest_two_surfaces_set_the_trust_radius),
        cmocka_unit_test(the_gradient_agrees_with_central_differences),
        cmocka_unit_test(on_a_surface_the_gradient_holds_along_it),
        cmocka_unit_test(memory_never_changes_a_bit),
        cmocka_unit_test(the_place_of_the_room_does_not_matter),
        cmocka_unit_test(the_unit_of_length_matters_to_the_gaussian_alone),
        cmocka_unit_test(fields_are_found_by_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
