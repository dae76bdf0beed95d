// Polygons with holes become triangles, whatever their rings are.
#include "cut/stage.h"
#include "test.h"
#include "unit/cut_scene.h"

// Of the cube from -5 to 5: its top's corners, counter-clockwise seen from above.
static void add_top(const struct cut_mesh *mesh, struct stage *stage) {
    static const double corners[4][2] = {{-5, -5}, {5, -5}, {5, 5}, {-5, 5}};
    stage_begin_ring(stage);
    for (int i = 0; i < 4; i++)
        for (uint32_t v = 0; v < cut_mesh_vertex_bound(mesh); v++) {
            vec3 p = cut_mesh_vertex(mesh, v);
            if (p.x == corners[i][0] && p.y == corners[i][1] && p.z == 5)
                stage_add_to_ring(stage, v);
        }
}

static double area_made(const struct cut_mesh *mesh, const struct stage *stage) {
    double sum = 0;
    for (uint32_t t = 0; t < stage->made_count; t++) {
        vec3 p[3];
        for (int i = 0; i < 3; i++)
            p[i] = cut_mesh_vertex(mesh, stage->made[t].corners[i]);
        sum += vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0])).z / 2;
    }
    return sum;
}

static void a_ring_becomes_triangles_with_its_label(void **state) {
    (void)state;
    struct cut_mesh *mesh = cube(5);
    struct stage *stage = stage_create();
    stage_add_region(stage, 7, (vec3){0, 0, 1});
    add_top(mesh, stage);
    assert_true(fill_regions(mesh, stage));
    assert_int_equal(stage->made_count, 2);
    assert_near(area_made(mesh, stage), 100, 1e-9);
    assert_int_equal(stage->made[1].label, 7);
    stage_destroy(&stage);
    cut_mesh_destroy(&mesh);
}

static void a_ring_without_vertices_is_no_polygon_and_no_hole(void **state) {
    (void)state;
    struct cut_mesh *mesh = cube(5);
    struct stage *stage = stage_create();
    stage_add_region(stage, 1, (vec3){0, 0, 1});
    stage_begin_ring(stage);
    stage_add_region(stage, 2, (vec3){0, 0, 1});
    add_top(mesh, stage);
    stage_begin_ring(stage);
    assert_true(fill_regions(mesh, stage));
    assert_int_equal(stage->made_count, 2);
    assert_near(area_made(mesh, stage), 100, 1e-9);
    stage_destroy(&stage);
    cut_mesh_destroy(&mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ring_becomes_triangles_with_its_label),
        cmocka_unit_test(a_ring_without_vertices_is_no_polygon_and_no_hole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
