#include "matrices.h"
#include "scene/world.h"
#include "test.h"

// All surfaces keep their closest feature around y, so that W is smooth there. Counts the features
// of those in reach.
static bool features_stay(const struct warp_scene *scene, vec3 y, double h, double reach,
                          int *counts) {
    int seen[3] = {0};
    for (int k = 0; k < scene->surface_count; k++) {
        struct closest c = world_contact(scene, k, y);
        if (c.distance < 0.3 || fabs(c.distance - reach) < 4 * h)
            return false;
        seen[c.feature] += c.distance < reach;
        for (int i = 0; i < 27; i++) {
            vec3 step = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
            struct closest near = world_contact(scene, k, vec3_add_scaled(y, 2 * h, step));
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
    vec3 ahead = world_warp(scene, field, vec3_add(y, step)).displacement;
    return vec3_sub(ahead, world_warp(scene, field, vec3_sub(y, step)).displacement);
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
    for (int kind = 0; kind < FIELD_INTEGRAL; kind++) {
        struct field field = field_default((enum field_kind)kind);
        field.strength = 0.7;
        int counts[3] = {0};
        for (int i = 0; i < 1500; i++) {
            world_place(&w, &r, i % 2);
            vec3 y = world_somewhere(&r);
            double reach = kind == FIELD_GAUSSIAN ? INFINITY : field.radius_mm;
            if (!features_stay(&w.scene, y, h, reach, counts))
                continue;
            mat3 gradient = world_warp(&w.scene, &field, y).gradient;
            assert_mat3_near(gradient, differences(&w.scene, &field, y, h),
                             1e-7 * (1 + mat3_norm(gradient)));
        }
        for (int feature = 0; feature < 3; feature++)
            assert_true(counts[feature] > 30);
    }
    world_fini(&w);
}

// On a surface the gradient is that of its own displacement, along the surface.
static void on_a_surface_the_gradient_holds_along_it(void **state) {
    (void)state;
    struct random r = {9};
    struct world w;
    world_create(&w, &r, true);
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    for (int i = 0; i < 500; i++) {
        world_place(&w, &r, i % 2);
        int surface = i % w.scene.surface_count;
        vec3 y = world_point_on(&w, surface, &r);
        struct closest c = world_contact(&w.scene, surface, y);
        double inside = fmin(c.weights[0], fmin(c.weights[1], c.weights[2]));
        if (c.feature != FEATURE_FACE || inside < 0.01 || world_clearance(&w, surface, y) < 1)
            continue;
        const struct mesh *mesh = w.scene.surfaces[surface].mesh;
        vec3 side = vec3_sub(mesh_corner(mesh, c.triangle, 1), mesh_corner(mesh, c.triangle, 0));
        quat turn = w.B[w.scene.surfaces[surface].body].rotation;
        vec3 step = quat_rotate(turn, vec3_scale(1e-3, side));
        struct warp warp = world_warp(&w.scene, &field, y);
        vec3 moved = world_warp(&w.scene, &field, vec3_add(y, step)).displacement;
        vec3 told = vec3_add(warp.displacement, mat3_apply(warp.gradient, step));
        bool bends = w.scene.surfaces[surface].other_share; // a share times a place
        assert_vec3_near(moved, told, bends ? 1e-6 : 1e-11);
    }
    world_fini(&w);
}

// And off it, on its outside: how W leaves Δ.
static void on_a_surface_the_gradient_holds_towards_its_outside(void **state) {
    (void)state;
    struct random r = {10};
    struct world w;
    world_create(&w, &r, true);
    int tried = 0;
    for (int i = 0; i < 1000; i++) {
        struct field field = field_default(i % 2 ? FIELD_GAUSSIAN : FIELD_INVERSE_DISTANCE);
        world_place(&w, &r, i % 4 < 2);
        int surface = i % w.scene.surface_count;
        vec3 y = world_point_on(&w, surface, &r);
        struct closest c = world_contact(&w.scene, surface, y);
        if (c.feature != FEATURE_FACE || world_clearance(&w, surface, y) < 1)
            continue;
        const struct mesh *mesh = w.scene.surfaces[surface].mesh;
        vec3 a = mesh_corner(mesh, c.triangle, 0);
        vec3 out = vec3_cross(vec3_sub(mesh_corner(mesh, c.triangle, 1), a),
                              vec3_sub(mesh_corner(mesh, c.triangle, 2), a));
        quat turn = w.B[w.scene.surfaces[surface].body].rotation;
        vec3 step = quat_rotate(turn, vec3_scale(1e-4 / vec3_length(out), out));
        struct warp warp = world_warp(&w.scene, &field, y);
        vec3 moved = world_warp(&w.scene, &field, vec3_add(y, step)).displacement;
        vec3 told = vec3_add(warp.displacement, mat3_apply(warp.gradient, step));
        assert_vec3_near(moved, told, 1e-6);
        tried++;
    }
    assert_true(tried > 500);
    world_fini(&w);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_gradient_agrees_with_central_differences),
        cmocka_unit_test(on_a_surface_the_gradient_holds_along_it),
        cmocka_unit_test(on_a_surface_the_gradient_holds_towards_its_outside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
