#include "warp/surface_mean.h"

#include "matrices.h"
#include "random.h"
#include "scene/bodies.h"
#include "scene/brute.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

struct surface {
    struct mesh mesh;
    float *displacement;
    struct surface_tree *tree;
    struct surface_mean *mean;
    struct query *query;
};

// Takes the mesh and the displacement.
static void surface_init(struct surface *out, struct mesh mesh, float *displacement) {
    struct error err;
    *out = (struct surface){.mesh = mesh, .displacement = displacement};
    out->tree = surface_tree_create(&out->mesh);
    out->mean = surface_mean_create(out->tree, displacement);
    if (query_create(&out->mesh, &out->query, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

static void surface_fini(struct surface *surface) {
    query_destroy(&surface->query);
    surface_mean_destroy(&surface->mean);
    surface_tree_destroy(&surface->tree);
    free(surface->displacement);
    mesh_fini(&surface->mesh);
}

static void surface_ring(struct surface *out) {
    struct mesh mesh;
    shape_torus(&mesh, 13, 3, 80, 20);
    float *displacement = shape_displacement(&mesh, 3, 5);
    surface_init(out, mesh, displacement);
}

static void surface_bone(struct surface *out) {
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){39, 27, 28}, 3, 16, 2);
    float *displacement = shape_displacement(&mesh, 3, 6);
    surface_init(out, mesh, displacement);
}

static double distance_to(const struct surface *s, vec3 p) {
    struct closest c;
    assert_true(query_closest(s->query, p, INFINITY, MESH_NONE, &c));
    return c.distance;
}

// 0.02 mm to 12 mm off the surface, on either side.
static vec3 somewhere(const struct surface *s, struct random *r) {
    uint32_t vertex = (uint32_t)(random_bits(r) % s->mesh.vertex_count);
    double off = pow(10, random_between(r, -1.7, 1.08));
    vec3 p;
    do
        p = vec3_add_scaled(mesh_vertex(&s->mesh, vertex), off, random_direction(r));
    while (distance_to(s, p) < 0.01);
    return p;
}

static struct surface_value value_at(const struct surface *s, vec3 p) {
    struct surface_value value;
    assert_true(surface_mean_at(s->mean, p, distance_to(s, p), &value));
    return value;
}

// ---- the integrals ----

static vec3 displacement_of(const float *displacement, uint32_t vertex) {
    const float *d = displacement + 3 * (size_t)vertex;
    return (vec3){(double)d[0], (double)d[1], (double)d[2]};
}

static double largest_displacement(const struct surface *s) {
    double largest = 0;
    for (uint32_t v = 0; v < s->mesh.vertex_count; v++)
        largest = fmax(largest, vec3_length(displacement_of(s->displacement, v)));
    return largest;
}

static void the_mean_is_its_integrals_to_a_thousandth(void **state) {
    (void)state;
    struct random r = {1};
    struct surface surfaces[2];
    surface_ring(&surfaces[0]);
    surface_bone(&surfaces[1]);
    double worst = 0;
    for (int i = 0; i < 60; i++) {
        const struct surface *s = &surfaces[i % 2];
        vec3 p = somewhere(s, &r);
        struct surface_value value = value_at(s, p);
        struct brute_mean truth = brute_mean(&s->mesh, s->displacement, p);
        double error = vec3_distance(value.displacement, truth.displacement);
        worst = fmax(worst, error / largest_displacement(s));
        double extent = s->tree->nodes[0].piece.radius;
        assert_true(vec3_distance(value.point, truth.point) < 2e-3 * extent);
    }
    print_message("largest error: %.2g of the largest displacement\n", worst);
    assert_true(worst < 1e-3);
    surface_fini(&surfaces[0]);
    surface_fini(&surfaces[1]);
}

// ---- derivatives ----

// Where no piece is taken otherwise on one side of p than on the other, which is rare: most points
// must agree as two exact derivatives do.
static void the_derivatives_agree_with_central_differences(void **state) {
    (void)state;
    struct random r = {2};
    struct surface s;
    surface_ring(&s);
    const double h = 1e-6;
    const int count = 300;
    int agree = 0;
    for (int i = 0; i < count; i++) {
        vec3 p = somewhere(&s, &r), axis = random_direction(&r);
        struct surface_value at = value_at(&s, p);
        struct surface_value ahead = value_at(&s, vec3_add_scaled(p, h, axis));
        struct surface_value behind = value_at(&s, vec3_add_scaled(p, -h, axis));
        vec3 change = vec3_scale(0.5 / h, vec3_sub(ahead.displacement, behind.displacement));
        vec3 slide = vec3_scale(0.5 / h, vec3_sub(ahead.point, behind.point));
        agree += vec3_distance(change, mat3_apply(at.change, axis)) < 1e-6 &&
                 vec3_distance(slide, mat3_apply(at.slide, axis)) < 1e-6;
    }
    print_message("%d of %d agree to 1e-6\n", agree, count);
    assert_true(agree > 0.95 * count);
    surface_fini(&s);
}

static void what_is_the_same_everywhere_is_its_own_mean(void **state) {
    (void)state;
    struct random r = {3};
    struct surface s;
    surface_bone(&s);
    for (uint32_t v = 0; v < s.mesh.vertex_count; v++)
        memcpy(s.displacement + 3 * (size_t)v, (float[3]){1, -2, 0.5f}, 3 * sizeof(float));
    struct surface_mean *mean = surface_mean_create(s.tree, s.displacement);
    for (int i = 0; i < 100; i++) {
        vec3 p = somewhere(&s, &r);
        struct surface_value value;
        assert_true(surface_mean_at(mean, p, distance_to(&s, p), &value));
        assert_vec3_near(value.displacement, ((vec3){1, -2, 0.5}), 1e-12);
        assert_mat3_near(value.change, (mat3){0}, 1e-10);
    }
    surface_mean_destroy(&mean);
    surface_fini(&s);
}

static void near_the_surface_the_mean_is_the_surfaces_own(void **state) {
    (void)state;
    struct random r = {4};
    struct surface s;
    surface_ring(&s);
    for (int i = 0; i < 300; i++) {
        vec3 a = mesh_vertex(&s.mesh, (uint32_t)(random_bits(&r) % s.mesh.vertex_count));
        for (double off = 1; off > 1e-4; off *= 0.3) {
            struct closest c;
            vec3 p = vec3_add_scaled(a, off, random_direction(&r));
            query_closest(s.query, p, INFINITY, MESH_NONE, &c);
            vec3 own = {0};
            for (int k = 0; k < 3; k++)
                own = vec3_add_scaled(
                    own, c.weights[k],
                    displacement_of(s.displacement,
                                    s.mesh.triangles[3 * c.triangle + (uint32_t)k]));
            if (c.distance > 1e-5)
                assert_true(vec3_distance(value_at(&s, p).displacement, own) < 0.6 * off);
        }
    }
    surface_fini(&s);
}

// ---- updates ----

static void displace(struct surface *s, uint32_t vertex, struct random *r) {
    for (int i = 0; i < 3; i++)
        s->displacement[3 * (size_t)vertex + (size_t)i] = (float)random_between(r, -2, 2);
}

static void assert_same_bits(const struct surface *s, const struct surface_mean *other,
                             struct random *r) {
    for (int i = 0; i < 50; i++) {
        vec3 p = somewhere(s, r);
        struct surface_value one, two;
        assert_true(surface_mean_at(s->mean, p, distance_to(s, p), &one));
        assert_true(surface_mean_at(other, p, distance_to(s, p), &two));
        assert_memory_equal(&one, &two, sizeof one);
    }
}

static void updates_give_the_bits_of_a_new_mean_whatever_their_order(void **state) {
    (void)state;
    struct random r = {5};
    struct surface s;
    surface_ring(&s);
    struct surface_mean *backwards = surface_mean_create(s.tree, s.displacement);
    for (int round = 0; round < 20; round++) {
        uint32_t changed[40], reversed[40], count = 1 + (uint32_t)(random_bits(&r) % 40);
        for (uint32_t i = 0; i < count; i++) {
            changed[i] = (uint32_t)(random_bits(&r) % s.mesh.vertex_count);
            displace(&s, changed[i], &r);
        }
        for (uint32_t i = 0; i < count; i++) {
            reversed[i] = changed[count - 1 - i];
            surface_mean_update(backwards, &reversed[i], 1);
        }
        surface_mean_update(s.mean, changed, count);
        struct surface_mean *fresh = surface_mean_create(s.tree, s.displacement);
        assert_same_bits(&s, fresh, &r);
        assert_same_bits(&s, backwards, &r);
        surface_mean_destroy(&fresh);
    }
    surface_mean_destroy(&backwards);
    surface_fini(&s);
}

// ---- units, and meshes of all kinds ----

static void the_unit_of_length_does_not_matter(void **state) {
    (void)state;
    struct random r = {7};
    struct surface small, large;
    surface_ring(&small);
    struct mesh mesh;
    mesh_copy(&mesh, &small.mesh);
    shape_scale(&mesh, 8);
    float *displacement = shape_displacement(&mesh, 0, 0);
    for (size_t i = 0; i < 3 * (size_t)mesh.vertex_count; i++)
        displacement[i] = 8 * small.displacement[i];
    surface_init(&large, mesh, displacement);
    for (int i = 0; i < 100; i++) {
        vec3 p = somewhere(&small, &r);
        struct surface_value a = value_at(&small, p), b = value_at(&large, vec3_scale(8, p));
        assert_vec3_near(vec3_scale(0.125, b.displacement), a.displacement, 1e-12);
        assert_mat3_near(b.change, a.change, 1e-10);
        assert_vec3_near(vec3_scale(0.125, b.point), a.point, 1e-12);
    }
    surface_fini(&small);
    surface_fini(&large);
}

static void slivers_and_triangles_without_area_do_no_harm(void **state) {
    (void)state;
    struct random r = {8};
    struct surface s;
    struct mesh mesh;
    shape_soup(&mesh, 20, 300, 3);
    float *displacement = shape_displacement(&mesh, 3, 7);
    surface_init(&s, mesh, displacement);
    for (int i = 0; i < 300; i++) {
        vec3 p = i % 2 ? somewhere(&s, &r) : random_in_box(&r, 30);
        struct surface_value value = value_at(&s, p);
        assert_true(vec3_length(value.displacement) < 3.01);
        assert_true(isfinite(mat3_norm(value.change)) && isfinite(mat3_norm(value.slide)));
    }
    surface_fini(&s);
}

static void without_area_there_is_no_mean(void **state) {
    (void)state;
    struct mesh mesh;
    mesh_init(&mesh, 3, 1);
    for (uint32_t i = 0; i < 3; i++) {
        mesh_set_vertex(&mesh, i, (vec3){i, 0, 0});
        mesh.triangles[i] = i;
    }
    struct surface_tree *tree = surface_tree_create(&mesh);
    struct surface_mean *mean = surface_mean_create(tree, (float[9]){1, 1, 1, 1, 1, 1, 1, 1, 1});
    struct surface_value value;
    assert_false(surface_mean_at(mean, (vec3){1, 0, 2}, 2, &value));
    surface_mean_destroy(&mean);
    surface_tree_destroy(&tree);
    mesh_fini(&mesh);
}

static void however_far_away_the_mean_is_finite_or_told_to_be_none(void **state) {
    (void)state;
    struct random r = {9};
    struct surface s;
    surface_ring(&s);
    for (int exponent = 0; exponent <= 300; exponent++) {
        vec3 p = vec3_scale(20 * pow(10, exponent), random_direction(&r));
        struct surface_value value;
        bool told = surface_mean_at(s.mean, p, vec3_length(p), &value);
        assert_true(told || exponent > 140);
        assert_true(!told ||
                    (vec3_length(value.displacement) < 3.01 && isfinite(mat3_norm(value.change))));
    }
    surface_fini(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_mean_is_its_integrals_to_a_thousandth),
        cmocka_unit_test(the_derivatives_agree_with_central_differences),
        cmocka_unit_test(what_is_the_same_everywhere_is_its_own_mean),
        cmocka_unit_test(near_the_surface_the_mean_is_the_surfaces_own),
        cmocka_unit_test(updates_give_the_bits_of_a_new_mean_whatever_their_order),
        cmocka_unit_test(the_unit_of_length_does_not_matter),
        cmocka_unit_test(slivers_and_triangles_without_area_do_no_harm),
        cmocka_unit_test(without_area_there_is_no_mean),
        cmocka_unit_test(however_far_away_the_mean_is_finite_or_told_to_be_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
