#include "base/check.h"
#include "matrices.h"
#include "scene/brute.h"
#include "scene/world.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static void world_integrate(struct world *w, struct random *r) {
    world_create(w, r, true);
    bodies_integrate(&w->bodies);
}

// ---- the formula ----

static double smooth(double a) {
    a = a < 0 ? 0 : a > 1 ? 1 : a;
    return a * a * (3 - 2 * a);
}

// One surface that moves with its body alone: D' and Δ.
static double oracle_distance(const struct warp_scene *scene, int surface, vec3 y, vec3 *out_delta,
                              double *out_reach) {
    const struct warp_surface *s = &scene->surfaces[surface];
    pose B = scene->T_world_body[s->body], M = scene->correction[s->body];
    vec3 p = pose_apply_inverse(B, y);
    struct brute_mean mean = brute_integral(s->mesh, s->displacement, p);
    double D = sqrt(3.14159265358979323846 / mean.weight), d = brute_distance(s->mesh, p);
    double m = vec3_distance(pose_apply(M, y), y), e = vec3_distance(mean.point, p) / D;
    double R = hypot(15, m);
    double boost = 1 + 2 / (1 + m * m) * pow(fmax(1 - e * e, 0), 2);
    double weight = boost * fmax(1 / D - 1 / R, 0) * (1 - smooth((d - 0.7 * R) / (0.3 * R)));
    vec3 moved = pose_apply(B, vec3_add(mean.point, mean.displacement));
    *out_delta = vec3_sub(pose_apply(M, moved), pose_apply(B, mean.point));
    *out_reach = R;
    return fmin(1 / (weight + 1 / R), (1 + 1 / (m * m)) * d);
}

static vec3 oracle_warp(const struct warp_scene *scene, vec3 y) {
    double sum = 0, largest = 0;
    vec3 W = {0};
    for (int i = 0; i < scene->surface_count; i++) {
        vec3 delta;
        double reach, weight = 1 / oracle_distance(scene, i, y, &delta, &reach);
        weight -= 1 / reach;
        largest = fmax(largest,
                       vec3_distance(pose_apply(scene->correction[scene->surfaces[i].body], y), y));
        W = vec3_add_scaled(W, fmax(weight, 0), delta);
        sum += fmax(weight, 0);
    }
    double b = 1 / (1 + largest * largest), rest = (1 + b) / hypot(15, largest) / (1 + b * sum);
    return vec3_scale(1 / (sum + rest), W);
}

static void the_warp_is_its_formula(void **state) {
    (void)state;
    struct random r = {1};
    struct world w;
    world_integrate(&w, &r);
    w.scene.surface_count = 4; // the last one bridges
    double worst = 0;
    for (int i = 0; i < 40; i++) {
        world_place(&w, &r, true);
        vec3 y = world_somewhere(&r);
        struct field field = field_default(FIELD_INTEGRAL);
        vec3 W = world_warp(&w.scene, &field, y).displacement;
        worst = fmax(worst, vec3_distance(W, oracle_warp(&w.scene, y)));
    }
    print_message("largest difference: %.2g mm\n", worst);
    assert_true(worst < 0.05);
    world_fini(&w);
}

// ---- touch ----

static void on_a_surface_the_warp_is_its_displacement_exactly(void **state) {
    (void)state;
    struct random r = {2};
    struct world w;
    world_integrate(&w, &r);
    int touched = 0;
    for (int i = 0; i < 500; i++) {
        world_place(&w, &r, i % 2);
        struct field field = field_default(FIELD_INTEGRAL);
        field.skin_mm = i % 4 < 2 ? 0 : 0.1;
        int surface = i % w.scene.surface_count;
        vec3 y = world_point_on(&w, surface, &r), away = random_direction(&r);
        if (world_clearance(&w, surface, y) < 0.5)
            continue;
        struct closest c = world_contact(&w.scene, surface, y);
        vec3 delta = warp_of_contact(&w.scene, surface, &c);
        assert_vec3_near(world_warp(&w.scene, &field, y).displacement, delta, 0);
        for (double h = 0.1; h > 1e-10; h *= 0.5) {
            struct warp near = world_warp(&w.scene, &field, vec3_add_scaled(y, h, away));
            assert_true(vec3_distance(near.displacement, delta) < 20 * h);
        }
        touched++;
    }
    assert_true(touched > 250);
    world_fini(&w);
}

static void on_a_surface_the_gradient_holds_towards_its_outside(void **state) {
    (void)state;
    struct random r = {3};
    struct world w;
    world_integrate(&w, &r);
    int tried = 0;
    for (int i = 0; i < 600; i++) {
        struct field field = field_default(FIELD_INTEGRAL);
        world_place(&w, &r, i % 2);
        int surface = i % w.scene.surface_count;
        vec3 y = world_point_on(&w, surface, &r);
        struct closest c = world_contact(&w.scene, surface, y);
        double inside = fmin(c.weights[0], fmin(c.weights[1], c.weights[2]));
        if (c.feature != FEATURE_FACE || inside < 0.1 || world_clearance(&w, surface, y) < 1)
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
        assert_vec3_near(moved, told, 2e-6);
        tried++;
    }
    assert_true(tried > 200);
    world_fini(&w);
}

static void where_two_surfaces_touch_the_warp_is_their_mean(void **state) {
    (void)state;
    struct random r = {4};
    struct bodies walls;
    bodies_walls(&walls, 0, 3);
    bodies_integrate(&walls);
    pose B = pose_identity();
    struct warp_scene scene = {walls.surfaces, walls.count, &B, NULL};
    struct field field = field_default(FIELD_INTEGRAL);
    for (int i = 0; i < 50; i++) {
        vec3 y = random_in_box(&r, 25);
        y.z = i % 2 ? 0 : random_between(&r, -9e-7, 9e-7);
        assert_vec3_near(world_warp(&scene, &field, y).displacement, ((vec3){0, 0, 1.5}), 1e-14);
    }
    bodies_fini(&walls);
}

// ---- derivatives ----

static vec3 difference(const struct warp_scene *scene, const struct field *field, vec3 y,
                       vec3 step) {
    vec3 ahead = world_warp(scene, field, vec3_add(y, step)).displacement;
    return vec3_sub(ahead, world_warp(scene, field, vec3_sub(y, step)).displacement);
}

// Of fourth order.
static vec3 slope_along(const struct warp_scene *scene, const struct field *field, vec3 y,
                        vec3 axis, double h) {
    vec3 one = difference(scene, field, y, vec3_scale(h, axis));
    vec3 two = difference(scene, field, y, vec3_scale(2 * h, axis));
    return vec3_scale(1 / (12 * h), vec3_sub(vec3_scale(8, one), two));
}

// Within some steps of h the closest features stay, and with them the slopes of d.
static bool features_stay(const struct warp_scene *scene, vec3 y, vec3 axis, double h) {
    for (int k = 0; k < scene->surface_count; k++) {
        struct closest c = world_contact(scene, k, y);
        for (int i = -3; i <= 3; i++) {
            struct closest near = world_contact(scene, k, vec3_add_scaled(y, i * h, axis));
            if (near.triangle != c.triangle || near.feature != c.feature ||
                near.corner != c.corner || near.distance < 1e-3)
                return false;
        }
    }
    return true;
}

static void the_gradient_agrees_with_central_differences(void **state) {
    (void)state;
    struct random r = {5};
    struct world w;
    world_integrate(&w, &r);
    double worst = 0;
    int tried = 0;
    for (int i = 0; i < 1500; i++) {
        world_place(&w, &r, i % 4 < 2);
        struct field field = field_default(FIELD_INTEGRAL);
        field.skin_mm = i % 8 < 4 ? 0 : 0.05;
        field.strength = i % 3 ? 1 : 0.7;
        vec3 axis = random_direction(&r), y = world_somewhere(&r);
        if (i % 2)
            y = vec3_add_scaled(world_point_on(&w, i % 5, &r), random_between(&r, 0.02, 0.5),
                                random_direction(&r));
        double d = world_warp(&w.scene, &field, y).nearest_mm, h = fmin(1e-5, 1e-5 * d);
        if (!features_stay(&w.scene, y, axis, h))
            continue;
        mat3 gradient = world_warp(&w.scene, &field, y).gradient;
        vec3 slope = slope_along(&w.scene, &field, y, axis, h);
        worst = fmax(worst,
                     vec3_distance(slope, mat3_apply(gradient, axis)) / (1 + mat3_norm(gradient)));
        tried++;
    }
    print_message("largest difference of %d: %.2g\n", tried, worst);
    assert_true(tried > 500);
    assert_true(worst < 4e-7);
    world_fini(&w);
}

// ---- jumps ----

static void bend(struct mesh *mesh, double radius) {
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = mesh_vertex(mesh, v);
        double angle = p.z / radius, across = radius + p.x;
        mesh_set_vertex(mesh, v, (vec3){across * cos(angle), across * sin(angle), p.y});
    }
}

// A C of one group beside another C of the same group: a crevice 0.2 mm wide between them.
static void crevice(struct bodies *out) {
    struct mesh a, b, both;
    shape_bumpy(&a, (vec3){2.5, 2.5, 18}, 0, 12, 1);
    shape_bumpy(&b, (vec3){2.5, 2.5, 18}, 0, 12, 1);
    bend(&a, 7);
    bend(&b, 7);
    shape_move(&b, (pose){quat_identity(), {0, 0, 5.2}});
    mesh_init(&both, a.vertex_count + b.vertex_count, a.triangle_count + b.triangle_count);
    for (uint32_t v = 0; v < both.vertex_count; v++)
        mesh_set_vertex(&both, v,
                        v < a.vertex_count ? mesh_vertex(&a, v)
                                           : mesh_vertex(&b, v - a.vertex_count));
    for (uint32_t i = 0; i < 3 * both.triangle_count; i++)
        both.triangles[i] = i < 3 * a.triangle_count
                                ? a.triangles[i]
                                : b.triangles[i - 3 * a.triangle_count] + a.vertex_count;
    mesh_fini(&a);
    mesh_fini(&b);
    float *displacement = shape_displacement(&both, 3, 4);
    *out = (struct bodies){0};
    bodies_add(out, &both, displacement, 0);
    bodies_integrate(out);
}

// What of W's change over 0.01 mm of a line its derivative does not account for.
static double largest_jump(const struct warp_scene *scene, enum field_kind kind, vec3 from,
                           vec3 to) {
    struct field field = field_default(kind);
    double length = vec3_distance(from, to), largest = 0;
    struct warp before = world_warp(scene, &field, from);
    for (int i = 1; i < length / 0.01; i++) {
        vec3 step = vec3_scale(0.01 / length, vec3_sub(to, from));
        struct warp at = world_warp(scene, &field, vec3_add_scaled(from, i, step));
        double change = vec3_distance(at.displacement, before.displacement);
        double told = fmax(vec3_length(mat3_apply(at.gradient, step)),
                           vec3_length(mat3_apply(before.gradient, step)));
        if (fmin(at.nearest_mm, before.nearest_mm) > 0.02) // not through the surface
            largest = fmax(largest, change - told);
        before = at;
    }
    return largest;
}

static void nowhere_does_the_warp_jump_not_even_in_a_crevice(void **state) {
    (void)state;
    struct random r = {6};
    struct bodies bodies;
    crevice(&bodies);
    pose B = pose_identity();
    struct warp_scene scene = {bodies.surfaces, 1, &B, NULL};
    double closest = 0, integral = 0;
    for (int line = 0; line < 60; line++) {
        vec3 from = random_in_box(&r, 9), to = random_in_box(&r, 9);
        if (line % 2) // between the sheets
            from.z = to.z = random_between(&r, 2.55, 2.65);
        closest = fmax(closest, largest_jump(&scene, FIELD_INVERSE_DISTANCE, from, to));
        integral = fmax(integral, largest_jump(&scene, FIELD_INTEGRAL, from, to));
    }
    print_message("largest jump: %.2g mm with the closest point, %.2g mm\n", closest, integral);
    assert_true(closest > 0.1);
    assert_true(integral < 1e-3);
    bodies_fini(&bodies);
}

// ---- what does not matter ----

// To steps that single precision has 1.5 m away, too.
static void round_vertices(struct mesh *mesh) {
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = mesh_vertex(mesh, v);
        mesh_set_vertex(mesh, v,
                        (vec3){nearbyint(512 * p.x) / 512, nearbyint(512 * p.y) / 512,
                               nearbyint(512 * p.z) / 512});
    }
}

static void a_body_far_from_its_origin_has_the_same_warp(void **state) {
    (void)state;
    struct random r = {7};
    struct bodies near, far = {0};
    const vec3 away = {1500, -1500, 1500};
    bodies_knee(&near, 8);
    for (int i = 0; i < near.count; i++) {
        struct mesh mesh;
        float *displacement = alloc(3 * (size_t)near.meshes[i].vertex_count, sizeof(float));
        round_vertices(&near.meshes[i]);
        mesh_copy(&mesh, &near.meshes[i]);
        for (uint32_t v = 0; v < mesh.vertex_count; v++)
            mesh_set_vertex(&mesh, v, vec3_add(mesh_vertex(&mesh, v), away));
        for (size_t k = 0; k < 3 * (size_t)mesh.vertex_count; k++)
            displacement[k] = near.displacements[i][k];
        query_destroy(&near.queries[i]);
        struct error err;
        assert_int_equal(query_create(&near.meshes[i], &near.queries[i], &err), RESULT_OK);
        near.surfaces[i].query = near.queries[i];
        bodies_add(&far, &mesh, displacement, near.surfaces[i].body);
    }
    bodies_integrate(&near);
    bodies_integrate(&far);
    const pose B[3] = {pose_identity(), pose_identity(), pose_identity()};
    struct warp_scene one = {near.surfaces, near.count, B, NULL};
    struct warp_scene other = {far.surfaces, far.count, B, NULL};
    struct field field = field_default(FIELD_INTEGRAL);
    for (int i = 0; i < 300; i++) {
        vec3 y = world_somewhere(&r);
        struct warp a = world_warp(&one, &field, y);
        struct warp b = world_warp(&other, &field, vec3_add(y, away));
        assert_vec3_near(a.displacement, b.displacement, 1e-8);
        assert_mat3_near(a.gradient, b.gradient, 1e-6);
    }
    bodies_fini(&near);
    bodies_fini(&far);
}

static void the_unit_of_length_does_not_matter(void **state) {
    (void)state;
    struct random r = {8};
    struct bodies small, large = {0};
    crevice(&small);
    struct mesh mesh;
    mesh_copy(&mesh, &small.meshes[0]);
    shape_scale(&mesh, 8);
    float *displacement = shape_displacement(&mesh, 0, 0);
    for (size_t i = 0; i < 3 * (size_t)mesh.vertex_count; i++)
        displacement[i] = 8 * small.displacements[0][i];
    bodies_add(&large, &mesh, displacement, 0);
    bodies_integrate(&large);
    for (int i = 0; i < 300; i++) {
        pose B = pose_identity(), M = world_small_pose(&r, 0.1, i % 3), M8 = M;
        M8.translation = vec3_scale(8, M.translation);
        struct warp_scene scene = {small.surfaces, 1, &B, &M};
        struct warp_scene scene8 = {large.surfaces, 1, &B, &M8};
        struct field field = field_default(FIELD_INTEGRAL);
        field.skin_mm = i % 2 ? 0.1 : 0;
        struct field field8 = field;
        field8.radius_mm *= 8;
        field8.background_per_mm /= 8;
        field8.skin_mm *= 8;
        vec3 y = random_in_box(&r, 9);
        struct warp a = world_warp(&scene, &field, y);
        struct warp b = world_warp(&scene8, &field8, vec3_scale(8, y));
        assert_vec3_near(vec3_scale(0.125, b.displacement), a.displacement, 1e-11);
        assert_mat3_near(a.gradient, b.gradient, 1e-8);
    }
    bodies_fini(&small);
    bodies_fini(&large);
}

static void beyond_its_reach_there_is_no_warp_and_it_gets_there_smoothly(void **state) {
    (void)state;
    struct random r = {9};
    struct bodies walls;
    bodies_walls(&walls, 40, 3);
    bodies_integrate(&walls);
    pose B = pose_identity(), M = world_small_pose(&r, 0.1, 2);
    for (int i = 0; i < 4; i++) {
        struct warp_scene scene = {walls.surfaces, walls.count, &B, i % 2 ? &M : NULL};
        struct field field = field_default(FIELD_INTEGRAL);
        field.skin_mm = i < 2 ? 0 : 0.1;
        struct warp at = world_warp(&scene, &field, (vec3){1, 2, -20 + 14.999});
        assert_true(vec3_length(at.displacement) < 5e-3);
        at = world_warp(&scene, &field, (vec3){1, 2, -20 + 15.001});
        assert_true(vec3_length(at.displacement) == 0);
    }
    bodies_fini(&walls);
}

// A wall alone that its body's correction takes along its normal, farther than the field reaches
// off what is not corrected.
static void off_a_surface_that_goes_far_space_does_not_fold(void **state) {
    (void)state;
    struct bodies walls;
    bodies_walls(&walls, 80, 0);
    bodies_integrate(&walls);
    for (int i = 0; i < 2; i++) {
        pose B = pose_identity(), M = {quat_identity(), {0, 0, i ? -20 : 20}};
        struct warp_scene scene = {walls.surfaces, 1, &B, &M};
        struct field field = field_default(FIELD_INTEGRAL);
        field.skin_mm = 0.1;
        double least = 1;
        for (double h = 0.25; h < 30; h += 0.5) {
            mat3 by_y = world_warp(&scene, &field, (vec3){1, 2, h - 40}).gradient;
            least = fmin(least, mat3_determinant(mat3_add_scaled(mat3_identity(), 1, by_y)));
        }
        assert_true(least > 0.1);
        struct box place = {{1, 2, -40}, {1, 2, -10}};
        double reach = field_reach(&scene, &field, place);
        assert_near(reach, 25, 1e-12); // of 15 and 20
        struct warp at = world_warp(&scene, &field, (vec3){1, 2, reach - 0.01 - 40});
        assert_true(at.nearest == 0 && vec3_length(at.displacement) < 0.1);
        at = world_warp(&scene, &field, (vec3){1, 2, reach + 0.01 - 40});
        assert_true(at.nearest == -1 && vec3_length(at.displacement) == 0);
    }
    bodies_fini(&walls);
}

// As if it were not there, even where y is on it; the other fields take it.
static void what_gives_way_is_no_surface_of_it(void **state) {
    (void)state;
    struct random r = {11};
    struct world w;
    world_integrate(&w, &r);
    struct warp_surface all[BODIES_MAX];
    memcpy(all, w.bodies.surfaces, sizeof all);
    struct warp_scene with = w.scene;
    with.surfaces = all;
    all[0].gives_way = true;
    w.scene.surfaces++;
    w.scene.surface_count--;
    struct field field = field_default(FIELD_INTEGRAL), other = field_default(FIELD_SMOOTH);
    int nearest = 0;
    for (int i = 0; i < 300; i++) {
        world_place(&w, &r, true);
        with.T_world_body = w.scene.T_world_body;
        with.correction = w.scene.correction;
        vec3 y = pose_apply(with.T_world_body[all[0].body],
                            mesh_vertex(all[0].mesh, (uint32_t)i % all[0].mesh->vertex_count));
        y = i % 2 ? y : world_somewhere(&r);
        struct warp a = world_warp(&with, &field, y), b = world_warp(&w.scene, &field, y);
        assert_int_equal(memcmp(&a.displacement, &b.displacement, sizeof a.displacement), 0);
        assert_int_equal(memcmp(&a.gradient, &b.gradient, sizeof a.gradient), 0);
        assert_int_equal(a.nearest, b.nearest < 0 ? -1 : b.nearest + 1);
        nearest += world_warp(&with, &other, y).nearest == 0;
    }
    assert_true(nearest > 100);
    world_fini(&w);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_warp_is_its_formula),
        cmocka_unit_test(on_a_surface_the_warp_is_its_displacement_exactly),
        cmocka_unit_test(on_a_surface_the_gradient_holds_towards_its_outside),
        cmocka_unit_test(where_two_surfaces_touch_the_warp_is_their_mean),
        cmocka_unit_test(the_gradient_agrees_with_central_differences),
        cmocka_unit_test(nowhere_does_the_warp_jump_not_even_in_a_crevice),
        cmocka_unit_test(a_body_far_from_its_origin_has_the_same_warp),
        cmocka_unit_test(the_unit_of_length_does_not_matter),
        cmocka_unit_test(beyond_its_reach_there_is_no_warp_and_it_gets_there_smoothly),
        cmocka_unit_test(off_a_surface_that_goes_far_space_does_not_fold),
        cmocka_unit_test(what_gives_way_is_no_surface_of_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
