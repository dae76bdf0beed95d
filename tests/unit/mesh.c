#include "mesh/mesh.h"

#include "mesh/topology.h"
#include "random.h"
#include "scene/shapes.h"
#include "test.h"

#include <string.h>

#define PI 3.141592653589793

// ---- measures ----

static void a_box_has_its_volume_area_and_bounds(void **state) {
    (void)state;
    struct mesh box;
    shape_box(&box, (vec3){1, 2, 3.5});
    assert_near(mesh_volume(&box), 56, 1e-12);
    assert_near(mesh_area(&box), 2 * (8 + 14 + 28), 1e-12);
    struct box bounds = mesh_bounds(&box);
    assert_vec3_near(bounds.min, ((vec3){-1, -2, -3.5}), 0);
    assert_vec3_near(bounds.max, ((vec3){1, 2, 3.5}), 0);
    mesh_fini(&box);
}

// Refining a sphere takes both to the smooth sphere's, with the square of the triangles' size.
static void volume_and_area_of_a_sphere_converge(void **state) {
    (void)state;
    double off[2][2];
    for (int i = 0; i < 2; i++) {
        struct mesh sphere;
        shape_sphere(&sphere, 10, 20 << i);
        off[i][0] = 1 - mesh_volume(&sphere) / (4000 * PI / 3);
        off[i][1] = 1 - mesh_area(&sphere) / (400 * PI);
        mesh_fini(&sphere);
    }
    for (int k = 0; k < 2; k++) {
        assert_true(off[0][k] > 0 && off[0][k] < 0.005);
        assert_near(off[0][k] / off[1][k], 4, 0.1);
    }
}

static void moving_a_mesh_keeps_its_volume(void **state) {
    (void)state;
    struct random r = {5};
    for (int i = 0; i < 20; i++) {
        struct mesh bone;
        shape_bumpy(&bone, (vec3){20, 15, 12}, 2, 12, (uint64_t)i);
        double volume = mesh_volume(&bone), area = mesh_area(&bone);
        shape_move(&bone, random_pose(&r, 500)); // coordinates are floats: 3e-5 mm at 500
        assert_near(mesh_volume(&bone) / volume, 1, 1e-5);
        assert_near(mesh_area(&bone) / area, 1, 1e-5);
        mesh_fini(&bone);
    }
}

// Coordinates in steps of 1/1024 mm, which floats hold exactly at both places.
static void a_far_mesh_loses_no_digits_of_volume(void **state) {
    (void)state;
    struct mesh bone;
    shape_bumpy(&bone, (vec3){2, 1, 1.5}, 0.2, 5, 3);
    for (size_t i = 0; i < 3 * (size_t)bone.vertex_count; i++)
        bone.positions[i] = roundf(1024 * bone.positions[i]) / 1024;
    double volume = mesh_volume(&bone);
    shape_move(&bone, (pose){quat_identity(), {6000 + 0x1p-10, -4000 - 0x1p-10, 7000 + 0x1p-9}});
    assert_near(mesh_volume(&bone), volume, 1e-12);
    mesh_fini(&bone);
}

static void turning_triangles_inside_out_negates_the_volume(void **state) {
    (void)state;
    struct mesh torus;
    shape_torus(&torus, 10, 3, 24, 12);
    double volume = mesh_volume(&torus);
    assert_true(volume > 0);
    for (size_t t = 0; t < torus.triangle_count; t++) {
        uint32_t *v = torus.triangles + 3 * t, b = v[1];
        v[1] = v[2];
        v[2] = b;
    }
    assert_near(mesh_volume(&torus), -volume, 1e-9);
    mesh_fini(&torus);
}

static void a_copy_is_independent(void **state) {
    (void)state;
    struct mesh box, copy;
    shape_box(&box, (vec3){1, 1, 1});
    mesh_copy(&copy, &box);
    mesh_set_vertex(&box, 7, (vec3){9, 9, 9});
    assert_vec3_near(mesh_vertex(&copy, 7), ((vec3){1, 1, 1}), 0);
    assert_memory_equal(copy.triangles, box.triangles, 36 * sizeof(uint32_t));
    mesh_fini(&box);
    mesh_fini(&copy);
    assert_null(copy.positions);
}

// ---- meshes from outside ----

struct bad_mesh {
    const char *what;
    size_t corner; // of the box's triangles: gets `vertex`
    uint32_t vertex;
    size_t coordinate; // of its positions: gets `value`
    float value;
    uint32_t triangle_count;
    enum result result;
    const char *names; // what the error must say
};

static const struct bad_mesh bad_meshes[] = {
    {"no triangle", 0, 0, 0, 1, 0, RESULT_FORMAT, "no triangle"},
    {"an index one too high", 35, 8, 0, 1, 12, RESULT_FORMAT, "triangle 11 names vertex 8 of 8"},
    {"an index far too high", 16, UINT32_MAX, 0, 1, 12, RESULT_FORMAT, "triangle 5"},
    {"first and second corner equal", 1, 0, 0, 1, 12, RESULT_FORMAT, "triangle 0"},
    {"second and third corner equal", 2, 2, 0, 1, 12, RESULT_FORMAT, "triangle 0"},
    {"third and first corner equal", 5, 1, 0, 1, 12, RESULT_FORMAT, "triangle 1"},
    {"NaN", 0, 0, 5, NAN, 12, RESULT_INVALID, "vertex 1"},
    {"infinity", 0, 0, 23, INFINITY, 12, RESULT_INVALID, "vertex 7"},
    {"minus infinity", 0, 0, 9, -INFINITY, 12, RESULT_INVALID, "vertex 3"},
    {"11 m away", 0, 0, 12, 11000, 12, RESULT_INVALID, "vertex 4"},
    {"11 m away below", 0, 0, 14, -11000, 12, RESULT_INVALID, "vertex 4"},
};

static void bad_meshes_are_refused_by_name(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof bad_meshes / sizeof bad_meshes[0]; i++) {
        const struct bad_mesh *bad = &bad_meshes[i];
        struct mesh box;
        struct error err = {""};
        shape_box(&box, (vec3){1, 1, 1});
        assert_int_equal(mesh_validate(&box, &err), RESULT_OK);
        box.triangles[bad->corner] = bad->vertex;
        box.positions[bad->coordinate] = bad->value;
        box.triangle_count = bad->triangle_count;
        enum result result = mesh_validate(&box, &err);
        if (result != bad->result || !strstr(err.text, bad->names))
            fail_msg("%s: %s (%s)", bad->what, result_sentence(result), err.text);
        mesh_fini(&box);
    }
}

static void ten_metres_are_still_accepted(void **state) {
    (void)state;
    struct mesh box;
    shape_box(&box, (vec3){10000, 10000, 10000});
    assert_int_equal(mesh_validate(&box, NULL), RESULT_OK);
    mesh_fini(&box);
}

// ---- topology ----

static struct topology topology_and_release(struct mesh *mesh) {
    struct topology t = topology_of(mesh);
    mesh_fini(mesh);
    return t;
}

static void assert_sound(const struct topology *t, uint32_t components, int64_t genus) {
    assert_int_equal(t->components, components);
    assert_true(t->closed && t->manifold && t->oriented);
    assert_int_equal(t->open_edges + t->non_manifold_edges + t->non_manifold_vertices, 0);
    assert_int_equal(t->flipped_edges + t->unused_vertices, 0);
    assert_int_equal(t->euler, 2 * (int64_t)components - 2 * genus);
    assert_int_equal(t->genus, genus);
}

static void closed_surfaces_are_sound(void **state) {
    (void)state;
    struct mesh mesh, other;
    shape_sphere(&mesh, 1, 7);
    struct topology t = topology_and_release(&mesh);
    assert_sound(&t, 1, 0);
    shape_torus(&mesh, 3, 1, 9, 5);
    t = topology_and_release(&mesh);
    assert_sound(&t, 1, 1);
    shape_torus(&mesh, 3, 1, 9, 5);
    shape_torus(&other, 3, 1, 7, 4);
    shape_append(&mesh, &other);
    mesh_fini(&other);
    shape_box(&other, (vec3){1, 1, 1});
    shape_append(&mesh, &other);
    mesh_fini(&other);
    t = topology_and_release(&mesh);
    assert_sound(&t, 3, 2);
}

static void an_open_grid_counts_its_border(void **state) {
    (void)state;
    struct mesh grid;
    shape_grid(&grid, 1, 6);
    struct topology t = topology_and_release(&grid);
    assert_int_equal(t.open_edges, 24);
    assert_false(t.closed);
    assert_true(t.manifold && t.oriented);
    assert_int_equal(t.components, 1);
    assert_int_equal(t.euler, 1);
    assert_int_equal(t.genus, -1);
}

static void a_moebius_strip_cannot_be_oriented(void **state) {
    (void)state;
    struct mesh strip;
    shape_moebius(&strip, 10, 2, 15);
    struct topology t = topology_and_release(&strip);
    assert_true(t.flipped_edges > 0);
    assert_false(t.oriented);
    assert_false(t.closed);
    assert_true(t.manifold);
    assert_int_equal(t.open_edges, 30);
    assert_int_equal(t.euler, 0);
    assert_int_equal(t.genus, -1);
}

static void a_flipped_triangle_has_three_flipped_edges(void **state) {
    (void)state;
    struct mesh sphere;
    shape_sphere(&sphere, 1, 4);
    uint32_t *v = sphere.triangles + 30, b = v[1];
    v[1] = v[2];
    v[2] = b;
    struct topology t = topology_and_release(&sphere);
    assert_int_equal(t.flipped_edges, 3);
    assert_true(t.closed && t.manifold && !t.oriented);
    assert_int_equal(t.genus, -1);
}

static void a_missing_triangle_opens_three_edges(void **state) {
    (void)state;
    struct mesh sphere;
    shape_sphere(&sphere, 1, 4);
    sphere.triangle_count--;
    struct topology t = topology_and_release(&sphere);
    assert_int_equal(t.open_edges, 3);
    assert_true(!t.closed && t.manifold && t.oriented);
    assert_int_equal(t.genus, -1);
}

// A mesh from triangles alone; positions do not matter to topology.
static struct topology topology_of_triangles(const uint32_t *corners, uint32_t triangles,
                                             uint32_t vertices) {
    struct mesh mesh;
    mesh_init(&mesh, vertices, triangles);
    memcpy(mesh.triangles, corners, 3 * (size_t)triangles * sizeof *corners);
    memset(mesh.positions, 0, 3 * (size_t)vertices * sizeof(float));
    return topology_and_release(&mesh);
}

static void a_bow_tie_is_not_manifold_at_its_knot(void **state) {
    (void)state;
    static const uint32_t bow_tie[] = {0, 1, 2, 2, 3, 4};
    struct topology t = topology_of_triangles(bow_tie, 2, 5);
    assert_int_equal(t.non_manifold_vertices, 1);
    assert_int_equal(t.non_manifold_edges, 0);
    assert_false(t.manifold);
    assert_int_equal(t.components, 1);
    assert_int_equal(t.open_edges, 6);
}

static void three_sheets_in_a_point_count_once(void **state) {
    (void)state;
    static const uint32_t sheets[] = {0, 1, 2, 0, 3, 4, 0, 5, 6};
    struct topology t = topology_of_triangles(sheets, 3, 7);
    assert_int_equal(t.non_manifold_vertices, 1);
}

// Two tetrahedra that touch in a corner: closed, every edge fine, and yet no manifold.
static void solids_that_touch_in_a_corner_are_not_manifold(void **state) {
    (void)state;
    static const uint32_t solids[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2,
                                      3, 5, 4, 3, 4, 6, 4, 5, 6, 3, 6, 5};
    struct topology t = topology_of_triangles(solids, 8, 7);
    assert_int_equal(t.non_manifold_vertices, 1);
    assert_true(t.closed && t.oriented && !t.manifold);
    assert_int_equal(t.components, 1);
    assert_int_equal(t.genus, -1);
}

static void an_edge_of_three_triangles_is_not_manifold(void **state) {
    (void)state;
    static const uint32_t fins[] = {0, 1, 2, 1, 0, 3, 0, 1, 4};
    struct topology t = topology_of_triangles(fins, 3, 5);
    assert_int_equal(t.non_manifold_edges, 1);
    assert_int_equal(t.non_manifold_vertices, 0);
    assert_int_equal(t.open_edges, 6);
    assert_false(t.manifold);
}

static void unused_vertices_are_counted_and_nothing_else(void **state) {
    (void)state;
    static const uint32_t tetrahedron[] = {5, 7, 6, 5, 6, 9, 6, 7, 9, 5, 9, 7};
    struct topology t = topology_of_triangles(tetrahedron, 4, 12);
    assert_int_equal(t.unused_vertices, 8);
    assert_int_equal(t.components, 1);
    assert_int_equal(t.euler, 2);
    assert_int_equal(t.genus, 0);
    assert_true(t.closed && t.manifold && t.oriented);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_box_has_its_volume_area_and_bounds),
        cmocka_unit_test(volume_and_area_of_a_sphere_converge),
        cmocka_unit_test(moving_a_mesh_keeps_its_volume),
        cmocka_unit_test(a_far_mesh_loses_no_digits_of_volume),
        cmocka_unit_test(turning_triangles_inside_out_negates_the_volume),
        cmocka_unit_test(a_copy_is_independent),
        cmocka_unit_test(bad_meshes_are_refused_by_name),
        cmocka_unit_test(ten_metres_are_still_accepted),
        cmocka_unit_test(closed_surfaces_are_sound),
        cmocka_unit_test(an_open_grid_counts_its_border),
        cmocka_unit_test(a_moebius_strip_cannot_be_oriented),
        cmocka_unit_test(a_flipped_triangle_has_three_flipped_edges),
        cmocka_unit_test(a_missing_triangle_opens_three_edges),
        cmocka_unit_test(a_bow_tie_is_not_manifold_at_its_knot),
        cmocka_unit_test(three_sheets_in_a_point_count_once),
        cmocka_unit_test(solids_that_touch_in_a_corner_are_not_manifold),
        cmocka_unit_test(an_edge_of_three_triangles_is_not_manifold),
        cmocka_unit_test(unused_vertices_are_counted_and_nothing_else),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
