#include "warp/warp.h"

#include "matrices.h"
#include "scene/world.h"
#include "test.h"

#include <string.h>

static bool equal(vec3 a, vec3 b) {
    return a.x == b.x && a.y == b.y && a.z == b.z;
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
    vec3 corrected = vec3_add(mat3_apply(MR, virtual_point), M.translation);
    if (surface->other_share) {
        double share = 0;
        for (unsigned i = 0; i < 3; i++)
            share += best.weights[i] *
                     (double)surface->other_share[surface->mesh->triangles[3 * best.triangle + i]];
        pose other = scene->correction ? scene->correction[surface->other_body] : pose_identity();
        vec3 apart = vec3_sub(pose_apply(other, virtual_point), corrected);
        corrected = vec3_add_scaled(corrected, share, apart);
    }
    return vec3_sub(corrected, physical_point);
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
        world_place(&w, &r, i % 2);
        double off = pow(10, random_between(&r, -5.9, 0));
        vec3 near = vec3_add_scaled(world_point_on(&w, i % 5, &r), off, random_direction(&r));
        vec3 y = i % 3 ? world_somewhere(&r) : near;
        for (int kind = 0; kind < FIELD_INTEGRAL; kind++) {
            struct field field = field_default((enum field_kind)kind);
            field.strength = 0.25 * (i % 5);
            struct warp warp = world_warp(&w.scene, &field, y);
            vec3 whole = oracle_warp(&w.scene, &field, y);
            assert_vec3_near(warp.displacement, vec3_scale(field.strength, whole),
                             i % 3 ? 1e-10 : 1e-5); // what touching leaves out
        }
    }
    world_fini(&w);
}

// ---- on the surfaces ----

static void on_a_surface_the_warp_is_its_own_displacement_exactly(void **state) {
    (void)state;
    struct random r = {2};
    struct world w;
    world_create(&w, &r, true);
    int touched = 0;
    for (int i = 0; i < 1000; i++) {
        world_place(&w, &r, i % 2);
        int surface = i % w.scene.surface_count;
        vec3 y = world_point_on(&w, surface, &r);
        if (world_clearance(&w, surface, y) < 1e-3)
            continue;
        struct closest c = world_contact(&w.scene, surface, y);
        vec3 delta = warp_of_contact(&w.scene, surface, &c);
        double distance;
        assert_vec3_near(delta, oracle_delta(&w.scene, surface, y, &distance), 1e-11);
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct field field = field_default((enum field_kind)kind);
            struct warp warp = world_warp(&w.scene, &field, y);
            assert_true(equal(warp.displacement, delta));
            assert_int_equal(warp.nearest, surface);
            assert_true(warp.nearest_mm == c.distance);
        }
        touched++;
    }
    assert_true(touched > 500);
    world_fini(&w);
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
            assert_vec3_near(world_warp(&scene, &field, y).displacement, ((vec3){0, 0, 1.5}),
                             1e-14);
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
        vec3 y = world_point_on(&w, surface, &r), away = random_direction(&r);
        if (world_clearance(&w, surface, y) < 0.5)
            continue;
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct field field = field_default((enum field_kind)kind);
            vec3 delta = world_warp(&w.scene, &field, y).displacement;
            for (double h = kind == FIELD_GAUSSIAN ? 1e-4 : 0.1; h > 1e-10; h *= 0.5) {
                struct warp near = world_warp(&w.scene, &field, vec3_add_scaled(y, h, away));
                assert_true(vec3_distance(near.displacement, delta) < 200 * h);
            }
        }
    }
    world_fini(&w);
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
        struct warp warp = world_warp(&w.scene, &field, world_somewhere(&r));
        assert_true(equal(warp.displacement, (vec3){0, 0, 0}));
        assert_mat3_near(warp.gradient, (mat3){0}, 1e-15);
    }
    world_fini(&w);
}

// ---- reach ----

static void beyond_the_radius_there_is_no_warp(void **state) {
    (void)state;
    struct random r = {6};
    struct bodies walls;
    bodies_walls(&walls, 2, 3);
    pose B = pose_identity(), M = world_small_pose(&r, 0.1, 1);
    struct warp_scene scene = {walls.surfaces, walls.count, &B, &M};
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    double before = INFINITY;
    for (double gap = 0.1; gap < field.radius_mm; gap += 0.1) {
        struct warp warp = world_warp(&scene, &field, (vec3){1, 2, -1 - gap});
        assert_int_equal(warp.nearest, 0);
        double length = vec3_length(warp.displacement);
        assert_true(length < before);
        before = length;
    }
    struct warp rim = world_warp(&scene, &field, (vec3){1, 2, -1 - field.radius_mm + 1e-9});
    assert_true(vec3_length(rim.displacement) < 1e-8);
    for (int i = 0; i < 100; i++) {
        vec3 y = {random_between(&r, -9, 9), random_between(&r, -9, 9),
                  -1 - field.radius_mm - 1e-9 - i};
        struct warp warp = world_warp(&scene, &field, y);
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
        vec3 y = i % 3 ? world_somewhere(&r) : world_point_on(&w, i % w.scene.surface_count, &r);
        struct field field = field_default(i % 2 ? FIELD_GAUSSIAN : FIELD_INVERSE_DISTANCE);
        double first = INFINITY, second = INFINITY;
        for (int k = 0; k < w.scene.surface_count; k++) {
            double d = world_contact(&w.scene, k, y).distance;
            second = fmin(second, fmax(d, first));
            first = fmin(first, d);
        }
        struct warp warp = world_warp(&w.scene, &field, y);
        assert_near(warp.trust_radius_mm, fmin(fmax(first + second, 0.5), 2), 1e-15);
        if (warp.nearest >= 0)
            assert_true(warp.nearest_mm == first);
    }
    world_fini(&w);
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
        vec3 y = i % 7 ? bodies_knee_path(0.05 * i) : world_somewhere(&r);
        struct warp fresh = world_warp(&w.scene, &field, y), warp;
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
    world_fini(&w);
}

// Poses of the whole room: W and its gradient turn with it.
static void the_place_of_the_room_does_not_matter(void **state) {
    (void)state;
    struct random r = {11};
    struct world w;
    world_create(&w, &r, true);
    for (int i = 0; i < 200; i++) {
        world_place(&w, &r, true);
        struct field field = field_default(i % 2 ? FIELD_GAUSSIAN : FIELD_INVERSE_DISTANCE);
        vec3 y = world_somewhere(&r);
        struct warp here = world_warp(&w.scene, &field, y);
        pose T = random_pose(&r, 300);
        for (int k = 0; k < 3; k++) {
            w.B[k] = pose_compose(T, w.B[k]);
            w.M[k] = pose_compose(T, pose_compose(w.M[k], pose_inverse(T)));
        }
        struct warp there = world_warp(&w.scene, &field, pose_apply(T, y));
        mat3 R = quat_to_mat3(T.rotation);
        assert_vec3_near(there.displacement, mat3_apply(R, here.displacement), 1e-9);
        assert_mat3_near(there.gradient,
                         mat3_multiply(R, mat3_multiply(here.gradient, mat3_transpose(R))), 1e-8);
    }
    world_fini(&w);
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
        vec3 y = world_somewhere(&r), y8 = vec3_scale(8, y);
        struct warp a = world_warp(&w.scene, &inverse, y);
        struct warp b = world_warp(&scene, &inverse_large, y8);
        assert_vec3_near(vec3_scale(0.125, b.displacement), a.displacement, 1e-12);
        assert_mat3_near(a.gradient, b.gradient, 1e-11);
        struct warp cm = world_warp(&w.scene, &gaussian, y);
        struct warp mm = world_warp(&w.scene, &gaussian_mm, y);
        struct warp cm8 = world_warp(&scene, &gaussian, y8);
        largest =
            fmax(largest, vec3_distance(vec3_scale(0.125, cm8.displacement), cm.displacement));
        largest_mm = fmax(largest_mm, vec3_distance(mm.displacement, cm.displacement));
    }
    assert_true(largest > 0.1 && largest_mm > 0.1);
    bodies_fini(&large);
    world_fini(&w);
}

// Up to where distances overflow.
static void however_far_away_the_warp_is_finite(void **state) {
    (void)state;
    struct random r = {13};
    struct world w;
    world_create(&w, &r, true);
    for (int exponent = 0; exponent <= 307; exponent++)
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct field field = field_default((enum field_kind)kind);
            vec3 y = vec3_scale(pow(10, exponent), random_direction(&r));
            struct warp warp = world_warp(&w.scene, &field, y);
            assert_true(vec3_is_finite(warp.displacement));
            assert_true(isfinite(mat3_norm(warp.gradient)));
            assert_true(warp.trust_radius_mm >= 0.5 && warp.trust_radius_mm <= 2);
        }
    world_fini(&w);
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
        cmocka_unit_test(memory_never_changes_a_bit),
        cmocka_unit_test(the_place_of_the_room_does_not_matter),
        cmocka_unit_test(the_unit_of_length_matters_to_the_gaussian_alone),
        cmocka_unit_test(however_far_away_the_warp_is_finite),
        cmocka_unit_test(fields_are_found_by_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
