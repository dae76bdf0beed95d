#include "matrices.h"
#include "scene/world.h"
#include "test.h"

// ---- a trimmed C: an ellipsoid bent around z, one of whose arms has lost its inner margin ----

static void bend(struct mesh *mesh, double radius) {
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = mesh_vertex(mesh, v);
        double angle = p.z / radius, r = radius + p.x;
        mesh_set_vertex(mesh, v, (vec3){r * cos(angle), r * sin(angle), p.y});
    }
}

static float *trim(const struct mesh *mesh, double radius, double most_mm) {
    float *displacement = shape_displacement(mesh, 0, 0);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = mesh_vertex(mesh, v);
        double across = hypot(p.x, p.y), share = fmax(0, atan2(p.y, p.x));
        double out = most_mm * fmin(1, share) * fmax(0, fmin(1, (radius + 1 - across) / 3));
        displacement[3 * (size_t)v] = (float)(out * p.x / across);
        displacement[3 * (size_t)v + 1] = (float)(out * p.y / across);
    }
    return displacement;
}

static void c_shape(struct bodies *out, int n) {
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){2.5, 2.5, 18}, 0, n, 1);
    bend(&mesh, 7);
    float *displacement = trim(&mesh, 7, 1.2);
    *out = (struct bodies){0};
    bodies_add(out, &mesh, displacement, 0);
}

// Where no instrument comes.
static bool is_inside_c(vec3 p) {
    double x = (hypot(p.x, p.y) - 7) / 2.5, y = p.z / 2.5, z = 7 * atan2(p.y, p.x) / 18;
    return x * x + y * y + z * z < 1;
}

// Along straight lines beside the C, the largest change of W over 0.01 mm.
static double largest_jump(const struct warp_scene *scene, enum field_kind kind) {
    struct random r = {1};
    struct field field = field_default(kind);
    double largest = 0;
    for (int line = 0; line < 40; line++) {
        vec3 from = random_in_box(&r, 9), to = random_in_box(&r, 9);
        from.z *= 0.3;
        to.z *= 0.3;
        double length = vec3_distance(from, to);
        vec3 before = {0};
        bool was_inside = true;
        for (int i = 0; i < length / 0.01; i++) {
            vec3 y = vec3_lerp(from, to, 0.01 * i / length);
            bool inside = is_inside_c(y);
            vec3 W = world_warp(scene, &field, y).displacement;
            if (!inside && !was_inside)
                largest = fmax(largest, vec3_distance(W, before));
            before = W;
            was_inside = inside;
        }
    }
    return largest;
}

static void where_the_closest_point_jumps_the_smooth_warp_does_not(void **state) {
    (void)state;
    struct bodies bodies;
    c_shape(&bodies, 16);
    bodies_smooth(&bodies);
    pose B = pose_identity();
    struct warp_scene scene = {bodies.surfaces, 1, &B, NULL};
    double closest = largest_jump(&scene, FIELD_INVERSE_DISTANCE);
    double smooth = largest_jump(&scene, FIELD_SMOOTH);
    print_message("largest change over 0.01 mm: %.3g mm with the closest point, %.3g mm smooth\n",
                  closest, smooth);
    assert_true(closest > 0.1);
    assert_true(smooth <= 0.005);
    bodies_fini(&bodies);
}

// ---- what smooth has in common with inverse-distance ----

static void on_a_surface_the_smooth_warp_is_its_displacement_exactly(void **state) {
    (void)state;
    struct random r = {2};
    struct world w;
    world_create(&w, &r, true);
    bodies_smooth(&w.bodies);
    struct field field = field_default(FIELD_SMOOTH);
    int touched = 0;
    for (int i = 0; i < 500; i++) {
        world_place(&w, &r, i % 2);
        int surface = i % w.scene.surface_count;
        vec3 y = world_point_on(&w, surface, &r), away = random_direction(&r);
        if (world_clearance(&w, surface, y) < 0.5)
            continue;
        struct closest c = world_contact(&w.scene, surface, y);
        vec3 delta = warp_of_contact(&w.scene, surface, &c);
        assert_vec3_near(world_warp(&w.scene, &field, y).displacement, delta, 0);
        for (double h = 0.5; h > 1e-10; h *= 0.5) {
            struct warp near = world_warp(&w.scene, &field, vec3_add_scaled(y, h, away));
            assert_true(vec3_distance(near.displacement, delta) < 20 * h);
        }
        touched++;
    }
    assert_true(touched > 250);
    world_fini(&w);
}

static vec3 difference(const struct warp_scene *scene, const struct field *field, vec3 y,
                       vec3 step) {
    vec3 ahead = world_warp(scene, field, vec3_add(y, step)).displacement;
    return vec3_sub(ahead, world_warp(scene, field, vec3_sub(y, step)).displacement);
}

// But for the few where a closest point changes its feature, or a piece of a mean its share.
static void the_smooth_gradient_agrees_with_central_differences(void **state) {
    (void)state;
    struct random r = {3};
    struct world w;
    world_create(&w, &r, true);
    bodies_smooth(&w.bodies);
    const double h = 1e-6;
    int agree[2] = {0}, count[2] = {0};
    for (int i = 0; i < 1200; i++) {
        world_place(&w, &r, i % 4 < 2);
        struct field field = field_default(FIELD_SMOOTH);
        field.skin_mm = i % 8 < 4 ? 0 : 0.05;
        bool near = i % 2;
        vec3 y = near ? vec3_add_scaled(world_point_on(&w, i % 5, &r), random_between(&r, 0, 0.3),
                                        random_direction(&r))
                      : world_somewhere(&r);
        vec3 axis = random_direction(&r);
        struct warp warp = world_warp(&w.scene, &field, y);
        vec3 slope = vec3_scale(0.5 / h, difference(&w.scene, &field, y, vec3_scale(h, axis)));
        agree[near] += vec3_distance(slope, mat3_apply(warp.gradient, axis)) <
                       1e-5 * (1 + mat3_norm(warp.gradient));
        count[near]++;
    }
    print_message("%d of %d, near surfaces %d of %d\n", agree[0], count[0], agree[1], count[1]);
    assert_true(agree[0] > 0.98 * count[0] && agree[1] > 0.98 * count[1]);
    world_fini(&w);
}

// Δ̃ of one displaced and corrected surface: the mean of Δ itself, by brute force over small pieces.
static void a_corrected_surface_has_the_mean_of_its_corrected_displacement(void **state) {
    (void)state;
    struct random r = {4};
    struct bodies bodies;
    c_shape(&bodies, 24);
    bodies_smooth(&bodies);
    pose B = world_small_pose(&r, 0.5, 3), M = world_small_pose(&r, 0.2, 2);
    struct warp_scene scene = {bodies.surfaces, 1, &B, &M};
    struct field field = field_default(FIELD_SMOOTH);
    field.background_per_mm = 0; // so that W is Δ
    const struct mesh *mesh = &bodies.meshes[0];
    for (int i = 0; i < 50; i++) {
        vec3 p = random_in_box(&r, 4), y = pose_apply(B, p), sum = {0};
        double weight = 0;
        if (world_contact(&scene, 0, y).distance < 1.5)
            continue;
        for (uint32_t t = 0; t < mesh->triangle_count; t++) {
            vec3 x = {0}, u = {0};
            for (int k = 0; k < 3; k++) {
                uint32_t v = mesh->triangles[3 * t + (uint32_t)k];
                const float *d = bodies.displacements[0] + 3 * (size_t)v;
                x = vec3_add_scaled(x, 1.0 / 3, mesh_vertex(mesh, v));
                u = vec3_add_scaled(u, 1.0 / 3, (vec3){(double)d[0], (double)d[1], (double)d[2]});
            }
            vec3 a = mesh_corner(mesh, t, 0);
            vec3 across = vec3_cross(vec3_sub(mesh_corner(mesh, t, 1), a),
                                     vec3_sub(mesh_corner(mesh, t, 2), a));
            double w = vec3_length(across) / pow(vec3_distance(x, p), 5);
            vec3 target = pose_apply(M, pose_apply(B, vec3_add(x, u)));
            sum = vec3_add_scaled(sum, w, vec3_sub(target, pose_apply(B, x)));
            weight += w;
        }
        assert_vec3_near(world_warp(&scene, &field, y).displacement, vec3_scale(1 / weight, sum),
                         0.02);
    }
    bodies_fini(&bodies);
}

static void the_unit_of_length_does_not_matter_to_smooth(void **state) {
    (void)state;
    struct random r = {5};
    struct bodies small, large = {0};
    c_shape(&small, 12);
    struct mesh mesh;
    mesh_copy(&mesh, &small.meshes[0]);
    shape_scale(&mesh, 8);
    float *displacement = shape_displacement(&mesh, 0, 0);
    for (size_t i = 0; i < 3 * (size_t)mesh.vertex_count; i++)
        displacement[i] = 8 * small.displacements[0][i];
    bodies_add(&large, &mesh, displacement, 0);
    bodies_smooth(&small);
    bodies_smooth(&large);
    pose B = pose_identity();
    struct warp_scene scene = {small.surfaces, 1, &B, NULL}, scene8 = {large.surfaces, 1, &B, NULL};
    for (int i = 0; i < 300; i++) {
        struct field field = field_default(FIELD_SMOOTH);
        field.skin_mm = i % 2 ? 0.1 : 0;
        struct field field8 = field;
        field8.radius_mm *= 8;
        field8.background_per_mm /= 8;
        field8.skin_mm *= 8;
        vec3 y = random_in_box(&r, 9);
        struct warp a = world_warp(&scene, &field, y);
        struct warp b = world_warp(&scene8, &field8, vec3_scale(8, y));
        assert_vec3_near(vec3_scale(0.125, b.displacement), a.displacement, 1e-12);
        assert_mat3_near(a.gradient, b.gradient, 1e-9);
    }
    bodies_fini(&small);
    bodies_fini(&large);
}

static void without_means_smooth_is_inverse_distance(void **state) {
    (void)state;
    struct random r = {6};
    struct world w;
    world_create(&w, &r, true);
    struct field smooth = field_default(FIELD_SMOOTH);
    struct field inverse = field_default(FIELD_INVERSE_DISTANCE);
    for (int i = 0; i < 200; i++) {
        vec3 y = world_somewhere(&r);
        struct warp a = world_warp(&w.scene, &smooth, y), b = world_warp(&w.scene, &inverse, y);
        assert_vec3_near(a.displacement, b.displacement, 0);
        assert_mat3_near(a.gradient, b.gradient, 0);
    }
    world_fini(&w);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(where_the_closest_point_jumps_the_smooth_warp_does_not),
        cmocka_unit_test(on_a_surface_the_smooth_warp_is_its_displacement_exactly),
        cmocka_unit_test(the_smooth_gradient_agrees_with_central_differences),
        cmocka_unit_test(a_corrected_surface_has_the_mean_of_its_corrected_displacement),
        cmocka_unit_test(the_unit_of_length_does_not_matter_to_smooth),
        cmocka_unit_test(without_means_smooth_is_inverse_distance),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
