// What hides one point from another, against every triangle in long double.
#include "mesh/sight.h"

#include "random.h"
#include "scene/shapes.h"
#include "test.h"

#define CASES 4000

// 1: a triangle crosses the way; 0: none; -1: too near to an edge to tell.
static int brute_crosses(const struct mesh *mesh, vec3 from, vec3 to, double spare) {
    double length = vec3_distance(from, to);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0), u = vec3_sub(mesh_corner(mesh, t, 1), a),
             v = vec3_sub(mesh_corner(mesh, t, 2), a), way = vec3_sub(to, from);
        vec3 normal = vec3_cross(u, v);
        long double across = vec3_dot(normal, way), height = vec3_dot(normal, vec3_sub(a, from));
        if (fabsl(across) < 1e-9L)
            continue;
        long double along = height / across;
        if (along < 0 || along > 1 - spare / length)
            continue;
        vec3 p = vec3_sub(vec3_add_scaled(from, (double)along, way), a);
        long double area = vec3_dot(normal, normal);
        long double s = vec3_dot(vec3_cross(p, v), normal) / area;
        long double w = vec3_dot(vec3_cross(u, p), normal) / area;
        long double inside = fminl(fminl(s, w), 1 - s - w);
        if (fabsl(inside) < 1e-6L || fabsl(along - (1 - spare / length)) < 1e-9L)
            return -1;
        if (inside > 0)
            return 1;
    }
    return 0;
}

static void agree_on(const struct mesh *mesh, double half, double spare) {
    struct random r = {7};
    struct sight *sight;
    struct error err;
    struct sight_hint hint = {0}; // goes from case to case, as it changes no answer
    int hidden = 0, clear = 0;
    assert_ok(sight_create(mesh, 1, &sight, &err));
    for (int i = 0; i < CASES; i++) {
        vec3 from = random_in_box(&r, half), to = random_in_box(&r, half);
        int expected = brute_crosses(mesh, from, to, spare);
        if (expected < 0)
            continue;
        if (sight_is_clear(sight, 1, from, to, spare, &hint) != !expected)
            fail_msg("case %d: brute force says %d", i, expected);
        hidden += expected;
        clear += !expected;
    }
    assert_in_range(hidden, CASES / 20, CASES);
    assert_in_range(clear, CASES / 20, CASES);
    sight_destroy(&sight);
}

static void it_agrees_with_every_triangle_in_turn(void **state) {
    (void)state;
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){20, 30, 15}, 2, 12, 3);
    agree_on(&mesh, 40, 0);
    agree_on(&mesh, 40, 3);
    mesh_fini(&mesh);
    shape_soup(&mesh, 30, 60, 5);
    agree_on(&mesh, 30, 1);
    mesh_fini(&mesh);
    shape_grid(&mesh, 30, 5);
    agree_on(&mesh, 40, 0);
    mesh_fini(&mesh);
}

static void a_way_within_what_is_spared_is_clear(void **state) {
    (void)state;
    struct mesh mesh;
    struct sight *sight;
    struct error err;
    struct sight_hint hint = {0};
    shape_grid(&mesh, 10, 1);
    assert_ok(sight_create(&mesh, 1, &sight, &err));
    vec3 above = {1, 2, 1}, below = {1, 2, -1};
    assert_false(sight_is_clear(sight, 1, above, below, 0.9, &hint));
    assert_true(sight_is_clear(sight, 1, above, below, 1.1, &hint));
    assert_true(sight_is_clear(sight, 1, above, below, 5, &hint));
    assert_true(sight_is_clear(sight, 1, above, above, 0, &hint));
    sight_destroy(&sight);
    mesh_fini(&mesh);
}

// Two triangles share the diagonal of the square: no ray passes between them.
static void no_ray_passes_an_edge(void **state) {
    (void)state;
    struct mesh mesh;
    struct sight *sight;
    struct error err;
    struct sight_hint hint = {0};
    shape_grid(&mesh, 10, 4);
    assert_ok(sight_create(&mesh, 1, &sight, &err));
    for (int i = -99; i < 100; i++)
        assert_false(sight_is_clear(sight, 1, (vec3){0.1 * i, 0.1 * i, 20},
                                    (vec3){0.1 * i, 0.1 * i, -20}, 0, &hint));
    sight_destroy(&sight);
    mesh_fini(&mesh);
}

// Each case asks all sets of three meshes; the sight is of two of them.
static void only_the_meshes_asked_for_count(void **state) {
    (void)state;
    enum { MESHES = 3, OF_SIGHT = 5 };
    struct mesh meshes[MESHES];
    struct sight *sight;
    struct sight_hint hint = {1, 0}; // of a mesh that the sight does not have
    struct random r = {11};
    struct error err;
    int hidden_by[MESHES] = {0};
    for (int i = 0; i < MESHES; i++)
        shape_bumpy(&meshes[i], (vec3){20 - 5 * i, 12 + 6 * i, 15}, 2, 12, 3 + (uint64_t)i);
    assert_ok(sight_create(meshes, OF_SIGHT, &sight, &err));
    for (int i = 0; i < CASES / 8; i++) {
        vec3 from = random_in_box(&r, 40), to = random_in_box(&r, 40);
        int crosses[MESHES];
        for (int k = 0; k < MESHES; k++)
            hidden_by[k] += crosses[k] = brute_crosses(&meshes[k], from, to, 1);
        for (uint32_t which = 0; which < 1u << MESHES; which++) {
            bool hidden = false, near_an_edge = false;
            for (int k = 0; k < MESHES; k++) {
                bool counts = which & OF_SIGHT & 1u << k;
                hidden |= counts && crosses[k] == 1;
                near_an_edge |= counts && crosses[k] < 0;
            }
            if (!near_an_edge)
                assert_int_equal(sight_is_clear(sight, which, from, to, 1, &hint), !hidden);
        }
    }
    for (int k = 0; k < MESHES; k++)
        assert_in_range(hidden_by[k], CASES / 80, CASES);
    sight_destroy(&sight);
    for (int i = 0; i < MESHES; i++)
        mesh_fini(&meshes[i]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_agrees_with_every_triangle_in_turn),
        cmocka_unit_test(a_way_within_what_is_spared_is_clear),
        cmocka_unit_test(no_ray_passes_an_edge),
        cmocka_unit_test(only_the_meshes_asked_for_count),
    };
    return cmocka_run_group_tests_name("sight", tests, NULL, NULL);
}
