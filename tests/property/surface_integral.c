#include "warp/surface_integral.h"

#include "matrices.h"
#include "random.h"
#include "scene/bodies.h"
#include "scene/brute.h"
#include "test.h"
#include "warp/surface_walk.h"
#define WIDE 4
#include "warp/lanes.h"

#include <stdlib.h>
#include <string.h>

// One surface with its integral.
static void one(struct bodies *out, struct mesh *mesh, uint64_t seed) {
    float *displacement = shape_displacement(mesh, 3, seed);
    *out = (struct bodies){0};
    bodies_add(out, mesh, displacement, 0);
    bodies_integrate(out);
}

static void ring(struct bodies *out) {
    struct mesh mesh;
    shape_torus(&mesh, 13, 3, 80, 20);
    one(out, &mesh, 5);
}

static void bone(struct bodies *out) {
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){39, 27, 28}, 3, 16, 2);
    one(out, &mesh, 6);
}

static vec3 closest_to(const struct bodies *s, vec3 p) {
    struct closest c;
    assert_true(query_closest(s->queries[0], p, INFINITY, MESH_NONE, &c));
    return c.point;
}

// From 0.001 mm to 12 mm off the surface, on either side.
static vec3 somewhere(const struct bodies *s, struct random *r) {
    const struct mesh *mesh = &s->meshes[0];
    uint32_t t = (uint32_t)(random_bits(r) % mesh->triangle_count);
    double off = pow(10, random_between(r, -3, 1.08)), u = random_between(r, 0, 1);
    vec3 side = vec3_lerp(mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1), u), p;
    vec3 x = vec3_lerp(side, mesh_corner(mesh, t, 2), random_between(r, 0, 1));
    do
        p = vec3_add_scaled(x, off, random_direction(r));
    while (vec3_distance(p, closest_to(s, p)) < 5e-4);
    return p;
}

static struct surface_sight sight_at(const struct bodies *s, vec3 p) {
    struct surface_sight sight;
    assert_true(surface_integral_at(s->integrals[0], p, closest_to(s, p), &sight));
    return sight;
}

// ---- the integrals ----

static void the_tree_gives_the_integrals_to_a_few_hundredths(void **state) {
    (void)state;
    struct random r = {1};
    struct bodies surfaces[2];
    ring(&surfaces[0]);
    bone(&surfaces[1]);
    double weight = 0, field = 0, place = 0;
    for (int i = 0; i < 80; i++) {
        const struct bodies *s = &surfaces[i % 2];
        vec3 p = somewhere(s, &r);
        double d = vec3_distance(p, closest_to(s, p));
        struct surface_sight sight = sight_at(s, p);
        struct brute_mean truth = brute_integral(&s->meshes[0], s->displacements[0], p);
        weight = fmax(weight, fabs(sight.weight / truth.weight - 1));
        field = fmax(field, vec3_distance(sight.displacement, truth.displacement) / 3);
        place = fmax(place, vec3_distance(sight.point, truth.point) / d);
    }
    print_message("largest errors: weight %.2g, displacement %.2g, place %.2g\n", weight, field,
                  place);
    assert_true(weight < 0.04);
    assert_true(field < 8e-3);
    assert_true(place < 0.04);
    bodies_fini(&surfaces[0]);
    bodies_fini(&surfaces[1]);
}

// One large triangle, and p so near that its closed integral is all there is.
static void a_near_triangle_is_integrated_exactly(void **state) {
    (void)state;
    struct random r = {2};
    for (int i = 0; i < 40; i++) {
        struct mesh mesh;
        struct bodies s;
        mesh_init(&mesh, 3, 1);
        for (uint32_t c = 0; c < 3; c++) {
            mesh_set_vertex(&mesh, c, vec3_scale(2, random_direction(&r)));
            mesh.triangles[c] = c;
        }
        one(&s, &mesh, 7);
        vec3 middle = vec3_scale(1.0 / 3, vec3_add(vec3_add(mesh_corner(&s.meshes[0], 0, 0),
                                                            mesh_corner(&s.meshes[0], 0, 1)),
                                                   mesh_corner(&s.meshes[0], 0, 2)));
        vec3 p = vec3_add_scaled(middle, 0.3, random_direction(&r));
        if (vec3_distance(p, closest_to(&s, p)) < 0.05) {
            bodies_fini(&s);
            continue;
        }
        struct surface_sight sight = sight_at(&s, p);
        struct brute_mean truth = brute_integral(&s.meshes[0], s.displacements[0], p);
        assert_true(fabs(sight.weight / truth.weight - 1) < 2e-3); // what the oracle is good for
        assert_vec3_near(sight.displacement, truth.displacement, 2e-3);
        assert_vec3_near(sight.point, truth.point, 2e-3);
        bodies_fini(&s);
    }
}

// Everywhere: what is sent is the derivative of what is sent.
static void the_derivatives_agree_with_central_differences(void **state) {
    (void)state;
    struct random r = {3};
    struct bodies surfaces[2];
    ring(&surfaces[0]);
    bone(&surfaces[1]);
    double worst = 0;
    for (int i = 0; i < 2000; i++) {
        const struct bodies *s = &surfaces[i % 2];
        vec3 p = somewhere(s, &r), axis = random_direction(&r);
        double d = vec3_distance(p, closest_to(s, p)), h = 1e-5 * d;
        struct surface_sight at = sight_at(s, p), ahead = sight_at(s, vec3_add_scaled(p, h, axis)),
                             behind = sight_at(s, vec3_add_scaled(p, -h, axis));
        vec3 change = vec3_scale(0.5 / h, vec3_sub(ahead.displacement, behind.displacement));
        vec3 slide = vec3_scale(0.5 / h, vec3_sub(ahead.point, behind.point));
        double slope = 0.5 / h * (ahead.weight - behind.weight) / at.weight;
        worst = fmax(worst, vec3_distance(change, mat3_apply(at.change, axis)));
        worst = fmax(worst, vec3_distance(slide, mat3_apply(at.slide, axis)));
        worst = fmax(worst, d * fabs(slope - vec3_dot(at.weight_slope, axis) / at.weight));
    }
    print_message("largest difference: %.2g\n", worst);
    assert_true(worst < 1e-5);
    bodies_fini(&surfaces[0]);
    bodies_fini(&surfaces[1]);
}

// p in the very planes of near triangles, beside them.
static void in_the_plane_of_a_triangle_nothing_breaks(void **state) {
    (void)state;
    struct random r = {4};
    struct mesh mesh;
    struct bodies s;
    shape_grid(&mesh, 10, 6);
    one(&s, &mesh, 8);
    for (int i = 0; i < 400; i++) {
        double beside = pow(10, random_between(&r, -3, 1)), up = i % 3 ? 0.02 * (i % 20) : 0;
        vec3 p = {10 + beside, random_between(&r, -10, 10), up * beside};
        vec3 q = vec3_add(p, (vec3){0, 0, 1e-5 * beside});
        struct surface_sight at = sight_at(&s, p), above = sight_at(&s, q);
        vec3 told = vec3_scale(1e-5 * beside,
                               (vec3){at.change.m[0][2], at.change.m[1][2], at.change.m[2][2]});
        assert_true(isfinite(at.weight) && isfinite(mat3_norm(at.change)));
        assert_vec3_near(vec3_sub(above.displacement, at.displacement), told, 1e-7);
        assert_true(fabs(above.weight / at.weight - 1) < 1e-4);
    }
    bodies_fini(&s);
}

static void what_is_the_same_everywhere_is_its_own_mean(void **state) {
    (void)state;
    struct random r = {5};
    struct bodies s;
    bone(&s);
    for (uint32_t v = 0; v < s.meshes[0].vertex_count; v++)
        memcpy(s.displacements[0] + 3 * (size_t)v, (float[3]){1, -2, 0.5f}, 3 * sizeof(float));
    struct surface_integral *same = surface_integral_create(s.blocks[0], s.displacements[0]);
    for (int i = 0; i < 100; i++) {
        vec3 p = somewhere(&s, &r);
        struct surface_sight sight;
        assert_true(surface_integral_at(same, p, closest_to(&s, p), &sight));
        assert_vec3_near(sight.displacement, ((vec3){1, -2, 0.5}), 1e-9);
        assert_true(mat3_norm(sight.change) * vec3_distance(p, closest_to(&s, p)) < 1e-8);
    }
    surface_integral_destroy(&same);
    bodies_fini(&s);
}

// ---- bits ----

static void every_cpu_level_gives_the_same_bits(void **state) {
    (void)state;
    struct random r = {6};
    struct bodies s;
    ring(&s);
    struct block_moments *moments =
        aligned_alloc(BLOCK_ALIGN, s.blocks[0]->count * sizeof *moments);
    memset(moments, 0, s.blocks[0]->count * sizeof *moments);
    for (uint32_t i = s.blocks[0]->count; i-- > 0;)
        surface_block_gather(s.blocks[0], s.displacements[0], moments, i);
    for (int i = 0; i < 300; i++) {
        vec3 p = somewhere(&s, &r), off = vec3_sub(p, closest_to(&s, p));
        struct walk walks[WALK_LEVELS];
        for (int level = 0; level <= (int)surface_walk_best(); level++) {
            walks[level] =
                (struct walk){s.blocks[0], s.displacements[0], moments, p, off, vec3_dot(off, off)};
            surface_walk(&walks[level], (enum walk_level)level);
            assert_memory_equal(&walks[level].sums, &walks[0].sums, sizeof walks[0].sums);
        }
    }
    free(moments);
    bodies_fini(&s);
}

static void angles_are_good_to_the_last_digits(void **state) {
    (void)state;
    struct random r = {7};
    for (int i = 0; i < 20000; i++) {
        wide x, y;
        for (int k = 0; k < WIDE; k++) {
            x[k] = random_between(&r, -1, 1) * pow(10, random_between(&r, -8, 8));
            y[k] = random_between(&r, 1e-9, 1) * pow(10, random_between(&r, -8, 8));
        }
        wide angle = wide_angle(x, y);
        for (int k = 0; k < WIDE; k++)
            assert_true(fabs(angle[k] / atan2(y[k], x[k]) - 1) < 1e-15);
    }
}

static void displace(struct bodies *s, uint32_t vertex, struct random *r) {
    for (int i = 0; i < 3; i++)
        s->displacements[0][3 * (size_t)vertex + (size_t)i] = (float)random_between(r, -2, 2);
}

static void assert_same_bits(const struct bodies *s, const struct surface_integral *other,
                             struct random *r) {
    for (int i = 0; i < 50; i++) {
        vec3 p = somewhere(s, r);
        struct surface_sight a = sight_at(s, p), b;
        assert_true(surface_integral_at(other, p, closest_to(s, p), &b));
        assert_memory_equal(&a, &b, sizeof a);
    }
}

static void updates_give_the_bits_of_a_new_integral_whatever_their_order(void **state) {
    (void)state;
    struct random r = {8};
    struct bodies s;
    ring(&s);
    struct surface_integral *backwards = surface_integral_create(s.blocks[0], s.displacements[0]);
    for (int round = 0; round < 20; round++) {
        uint32_t changed[40], count = 1 + (uint32_t)(random_bits(&r) % 40);
        for (uint32_t i = 0; i < count; i++) {
            changed[i] = (uint32_t)(random_bits(&r) % s.meshes[0].vertex_count);
            displace(&s, changed[i], &r);
        }
        for (uint32_t i = count; i-- > 0;)
            surface_integral_update(backwards, &changed[i], 1);
        surface_integral_update(s.integrals[0], changed, count);
        struct surface_integral *fresh = surface_integral_create(s.blocks[0], s.displacements[0]);
        assert_same_bits(&s, fresh, &r);
        assert_same_bits(&s, backwards, &r);
        surface_integral_destroy(&fresh);
    }
    surface_integral_destroy(&backwards);
    bodies_fini(&s);
}

// ---- meshes of all kinds ----

static void slivers_and_triangles_without_area_do_no_harm(void **state) {
    (void)state;
    struct random r = {9};
    struct bodies s;
    struct mesh mesh;
    shape_soup(&mesh, 20, 300, 3);
    one(&s, &mesh, 7);
    for (int i = 0; i < 300; i++) {
        vec3 p = i % 2 ? somewhere(&s, &r) : random_in_box(&r, 30);
        struct surface_sight sight = sight_at(&s, p);
        assert_true(vec3_length(sight.displacement) < 3.01);
        assert_true(isfinite(mat3_norm(sight.change)) && isfinite(mat3_norm(sight.slide)));
    }
    bodies_fini(&s);
}

static void without_area_there_is_no_integral(void **state) {
    (void)state;
    struct mesh mesh;
    struct bodies s;
    mesh_init(&mesh, 3, 1);
    for (uint32_t i = 0; i < 3; i++) {
        mesh_set_vertex(&mesh, i, (vec3){i, 0, 0});
        mesh.triangles[i] = i;
    }
    one(&s, &mesh, 1);
    struct surface_sight sight;
    assert_false(surface_integral_at(s.integrals[0], (vec3){1, 0, 2}, (vec3){1, 0, 0}, &sight));
    bodies_fini(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_tree_gives_the_integrals_to_a_few_hundredths),
        cmocka_unit_test(a_near_triangle_is_integrated_exactly),
        cmocka_unit_test(the_derivatives_agree_with_central_differences),
        cmocka_unit_test(in_the_plane_of_a_triangle_nothing_breaks),
        cmocka_unit_test(what_is_the_same_everywhere_is_its_own_mean),
        cmocka_unit_test(every_cpu_level_gives_the_same_bits),
        cmocka_unit_test(angles_are_good_to_the_last_digits),
        cmocka_unit_test(updates_give_the_bits_of_a_new_integral_whatever_their_order),
        cmocka_unit_test(slivers_and_triangles_without_area_do_no_harm),
        cmocka_unit_test(without_area_there_is_no_integral),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
