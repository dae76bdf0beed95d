#include "import/repair.h"

#include "random.h"
#include "scene/shapes.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static const struct repair_settings gentle = {.weld_mm = 0, .island_share = 0.02};

static struct repair_report repaired(struct mesh *mesh) {
    struct repair_report report;
    struct error err;
    assert_true(repair_mesh(mesh, &gentle, &report));
    assert_int_equal(RESULT_OK, mesh_validate(mesh, &err));
    assert_int_equal(0, report.after.unused_vertices);
    return report;
}

static void assert_sound(const struct repair_report *report, uint32_t components) {
    assert_true(report->after.closed && report->after.manifold && report->after.oriented);
    assert_int_equal(components, report->after.components);
}

static void assert_place(const struct repair_report *report, enum repair_kind kind,
                         struct box expected) {
    assert_true(report->places[kind].somewhere);
    assert_vec3_near(report->places[kind].box.min, expected.min, 1e-6);
    assert_vec3_near(report->places[kind].box.max, expected.max, 1e-6);
}

static void turn(struct mesh *mesh, uint32_t t) {
    uint32_t *v = mesh->triangles + 3 * (size_t)t, second = v[1];
    v[1] = v[2];
    v[2] = second;
}

// Every triangle with vertices of its own, each corner off by up to `noise` in each coordinate.
static void explode(struct mesh *mesh, double noise, uint64_t seed) {
    struct random r = {seed};
    struct mesh soup;
    mesh_init(&soup, 3 * mesh->triangle_count, mesh->triangle_count);
    for (uint32_t i = 0; i < soup.vertex_count; i++) {
        vec3 p = mesh_corner(mesh, i / 3, (int)(i % 3));
        mesh_set_vertex(&soup, i, vec3_add(p, random_in_box(&r, noise)));
        soup.triangles[i] = i;
    }
    mesh_fini(mesh);
    *mesh = soup;
}

// Vertices of one place become one, whether they lie on open edges or not.
static void merge_places(struct mesh *mesh) {
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        for (uint32_t v = 0; v < mesh->triangles[i]; v++)
            if (memcmp(mesh->positions + 3 * v, mesh->positions + 3 * mesh->triangles[i], 12) == 0)
                mesh->triangles[i] = v;
}

static void box_at(struct mesh *mesh, vec3 centre) {
    shape_box(mesh, (vec3){1, 1, 1});
    shape_move(mesh, (pose){quat_identity(), centre});
}

static void two_boxes(struct mesh *mesh, vec3 second) {
    struct mesh other;
    box_at(mesh, (vec3){0});
    box_at(&other, second);
    shape_append(mesh, &other);
    mesh_fini(&other);
}

static void a_sound_mesh_stays_bit_for_bit(void **state) {
    (void)state;
    for (int i = 0; i < 4; i++) {
        struct mesh mesh, copy;
        if (i == 0)
            shape_sphere(&mesh, 20, 9);
        if (i == 1)
            shape_torus(&mesh, 20, 6, 30, 12);
        if (i == 2)
            shape_grid(&mesh, 10, 7);
        if (i == 3) // boxes that touch in a whole face, each closed
            two_boxes(&mesh, (vec3){2, 0, 0});
        mesh_copy(&copy, &mesh);
        struct repair_report report = repaired(&mesh);
        assert_int_equal(copy.vertex_count, mesh.vertex_count);
        assert_int_equal(copy.triangle_count, mesh.triangle_count);
        assert_memory_equal(copy.positions, mesh.positions, 12 * mesh.vertex_count);
        assert_memory_equal(copy.triangles, mesh.triangles, 12 * mesh.triangle_count);
        size_t before_padding = offsetof(struct topology, oriented) + sizeof(bool);
        assert_memory_equal(&report.before, &report.after, before_padding);
        assert_int_equal(report.before.euler, report.after.euler);
        assert_int_equal(report.before.genus, report.after.genus);
        assert_int_equal(0, report.turned_triangles + report.welded_vertices + report.voids);
        assert_int_equal(i == 1, report.after.genus > 0); // the handle is named
        mesh_fini(&mesh);
        mesh_fini(&copy);
    }
}

static void a_soup_is_welded_within_the_tolerance_and_no_farther(void **state) {
    (void)state;
    static const struct {
        double noise, weld_mm;
        bool closes;
    } rows[] = {
        {0, 0, true}, {0, 1e-3, true}, {1e-4, 1e-3, true}, {1e-4, 0, false}, {0.1, 1e-3, false}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct mesh mesh;
        struct repair_settings settings = {rows[i].weld_mm, 0};
        struct repair_report report;
        shape_sphere(&mesh, 20, 12);
        uint32_t vertices = mesh.vertex_count, triangles = mesh.triangle_count;
        explode(&mesh, rows[i].noise, 7);
        assert_true(repair_mesh(&mesh, &settings, &report));
        assert_int_equal(triangles, mesh.triangle_count);
        assert_int_equal(rows[i].closes, report.after.closed);
        if (rows[i].closes) {
            assert_int_equal(vertices, mesh.vertex_count);
            assert_int_equal(3 * triangles - vertices, report.welded_vertices);
            if (rows[i].noise == 0)
                assert_place(&report, REPAIR_WELDED, mesh_bounds(&mesh));
        }
        assert_true(report.welded_mm <= rows[i].weld_mm);
        assert_true((report.welded_mm > 0) == (rows[i].closes && rows[i].noise > 0));
        mesh_fini(&mesh);
    }
}

static void triangles_turned_at_random_are_turned_back_outwards(void **state) {
    (void)state;
    struct random r = {5};
    for (int share = 0; share <= 10; share += 2) {
        struct mesh mesh;
        uint32_t turned = 0;
        shape_torus(&mesh, 20, 6, 40, 14);
        shape_move(&mesh, (pose){quat_identity(), {300, -80, 20}});
        double volume = mesh_volume(&mesh);
        for (uint32_t t = 0; t < mesh.triangle_count; t++)
            if (random_between(&r, 0, 10) < share && ++turned)
                turn(&mesh, t);
        struct repair_report report = repaired(&mesh);
        assert_sound(&report, 1);
        assert_int_equal(turned, report.turned_triangles);
        assert_near(mesh_volume(&mesh), volume, 1e-9 * volume);
        mesh_fini(&mesh);
    }
}

static void each_component_faces_outwards_and_a_void_inwards(void **state) {
    (void)state;
    struct random r = {6};
    struct mesh mesh, other;
    shape_sphere(&mesh, 20, 8);
    double outer = mesh_volume(&mesh);
    shape_sphere(&other, 12, 8); // a void in the first
    double inner = mesh_volume(&other);
    shape_append(&mesh, &other);
    shape_move(&other, (pose){quat_identity(), {40, 0, 0}}); // beside it
    shape_append(&mesh, &other);
    shape_scale(&other, 0.5);
    shape_move(&other, (pose){quat_identity(), {-20, 0, 0}}); // a grain in the void
    double grain = mesh_volume(&other);
    shape_append(&mesh, &other);
    for (uint32_t t = 0; t < mesh.triangle_count; t++)
        if (random_bits(&r) & 1)
            turn(&mesh, t);
    struct repair_report report = repaired(&mesh);
    assert_sound(&report, 4);
    assert_int_equal(1, report.voids);
    assert_near(mesh_volume(&mesh), outer - inner + inner + grain, 1e-6 * outer);
    mesh_fini(&mesh);
    mesh_fini(&other);
}

static void an_open_sheet_is_kept_and_its_smaller_part_follows_the_larger(void **state) {
    (void)state;
    struct mesh mesh;
    shape_grid(&mesh, 10, 10);
    for (uint32_t t = 0; t < 60; t++)
        turn(&mesh, t);
    struct repair_report report = repaired(&mesh);
    assert_int_equal(60, report.turned_triangles);
    assert_int_equal(200, mesh.triangle_count);
    assert_int_equal(40, report.after.open_edges);
    assert_true(report.after.oriented);
    assert_place(&report, REPAIR_OPEN, mesh_bounds(&mesh));
    assert_false(report.places[REPAIR_CROWDED].somewhere);
    mesh_fini(&mesh);
}

static void a_surface_of_one_side_stays_and_is_named(void **state) {
    (void)state;
    struct mesh mesh;
    shape_moebius(&mesh, 20, 4, 30);
    struct repair_report report = repaired(&mesh);
    assert_int_equal(60, mesh.triangle_count);
    assert_false(report.after.oriented);
    assert_false(report.after.closed);
    mesh_fini(&mesh);
}

static void bad_triangles_and_unused_vertices_go_and_are_counted(void **state) {
    (void)state;
    struct mesh mesh;
    shape_box(&mesh, (vec3){1, 2, 3});
    uint32_t more[5][3] = {{0, 0, 1}, {2, 3, 2}, {5, 5, 5}, {0}, {0}};
    memcpy(more[3], mesh.triangles, sizeof more[3]);
    memcpy(more[4], mesh.triangles + 9, sizeof more[4]);
    more[4][0] = mesh.triangles[10]; // turned: another duplicate
    more[4][1] = mesh.triangles[9];
    shape_add_triangles(&mesh, 5, &more[0][0]);
    mesh.positions = realloc(mesh.positions, 3 * 11 * sizeof(float));
    memset(mesh.positions + 24, 0, 9 * sizeof(float));
    mesh.vertex_count = 11;
    struct repair_report report = repaired(&mesh);
    assert_int_equal(3, report.repeated_corners);
    assert_int_equal(2, report.duplicate_triangles);
    assert_int_equal(3, report.before.unused_vertices);
    assert_place(&report, REPAIR_DUPLICATE, (struct box){{-1, -2, -3}, {1, 2, 3}});
    assert_place(&report, REPAIR_REPEATED, (struct box){{-1, -2, -3}, {1, 2, 3}});
    assert_int_equal(8, mesh.vertex_count);
    assert_int_equal(12, mesh.triangle_count);
    assert_sound(&report, 1);
    assert_near(mesh_volume(&mesh), 48, 1e-6);
    mesh_fini(&mesh);
}

static void solids_that_share_an_edge_or_a_vertex_are_split_and_nothing_moves(void **state) {
    (void)state;
    static const struct {
        vec3 second;
        uint32_t copies;
    } rows[] = {{{2, 2, 0}, 2}, {{2, 2, 2}, 1}, {{-2, 0, 2}, 2}};
    for (size_t i = 0; i < 3; i++) {
        struct mesh mesh;
        two_boxes(&mesh, rows[i].second);
        merge_places(&mesh);
        turn(&mesh, 3);
        turn(&mesh, 20);
        struct repair_report report = repaired(&mesh);
        assert_int_equal(rows[i].copies == 2, report.before.non_manifold_edges);
        assert_int_equal(rows[i].copies, report.split_vertices);
        if (rows[i].copies == 1)
            assert_place(&report, REPAIR_SPLIT, (struct box){{1, 1, 1}, {1, 1, 1}});
        assert_int_equal(2, report.turned_triangles);
        assert_int_equal(16, mesh.vertex_count);
        assert_sound(&report, 2);
        assert_near(mesh_volume(&mesh), 16, 1e-5);
        mesh_fini(&mesh);
    }
}

static void a_wall_between_two_solids_goes_and_they_become_one(void **state) {
    (void)state;
    struct mesh mesh;
    two_boxes(&mesh, (vec3){2, 0, 0});
    merge_places(&mesh);
    struct repair_report report = repaired(&mesh);
    assert_int_equal(4, report.wall_triangles);
    assert_sound(&report, 1);
    assert_int_equal(20, mesh.triangle_count);
    assert_near(mesh_volume(&mesh), 16, 1e-5);
    mesh_fini(&mesh);
}

static void of_a_sheet_that_is_there_twice_one_side_is_kept(void **state) {
    (void)state;
    struct mesh mesh;
    shape_grid(&mesh, 10, 5);
    uint32_t count = mesh.triangle_count;
    uint32_t *back = malloc(3 * count * sizeof *back);
    memcpy(back, mesh.triangles, 3 * count * sizeof *back);
    shape_add_triangles(&mesh, count, back);
    for (uint32_t t = count; t < 2 * count; t++)
        turn(&mesh, t);
    free(back);
    struct repair_report report = repaired(&mesh);
    assert_int_equal(count, mesh.triangle_count);
    assert_int_equal(count, report.duplicate_triangles);
    assert_int_equal(0, report.wall_triangles + report.turned_triangles);
    mesh_fini(&mesh);
}

static void a_large_fin_stays_and_is_named(void **state) {
    (void)state;
    struct mesh mesh;
    shape_box(&mesh, (vec3){1, 1, 1});
    mesh.positions = realloc(mesh.positions, 27 * sizeof(float));
    mesh.vertex_count = 9;
    mesh_set_vertex(&mesh, 8, (vec3){4, 4, 4});
    uint32_t fin[3] = {mesh.triangles[0], mesh.triangles[1], 8};
    shape_add_triangles(&mesh, 1, fin);
    struct repair_report report = repaired(&mesh);
    assert_int_equal(13, mesh.triangle_count);
    assert_int_equal(9, mesh.vertex_count);
    assert_int_equal(1, report.after.non_manifold_edges);
    assert_int_equal(2, report.after.open_edges);
    mesh_fini(&mesh);
}

// On the edge of triangle t from its first corner to its second.
static void add_fin(struct mesh *mesh, uint32_t t, double height) {
    vec3 a = mesh_corner(mesh, t, 0), b = mesh_corner(mesh, t, 1);
    uint32_t fin[3] = {mesh->triangles[3 * t], mesh->triangles[3 * t + 1], mesh->vertex_count};
    mesh->positions = realloc(mesh->positions, 3 * (mesh->vertex_count + 1) * sizeof(float));
    vec3 apex = vec3_scale(1 + height / vec3_length(a), vec3_lerp(a, b, 0.5));
    mesh_set_vertex(mesh, mesh->vertex_count++, apex);
    shape_add_triangles(mesh, 1, fin);
}

static void small_fins_go_also_those_on_fins_and_the_rest_stays_bit_for_bit(void **state) {
    (void)state;
    struct mesh mesh, sound;
    shape_sphere(&mesh, 10, 16);
    mesh_copy(&sound, &mesh);
    uint32_t count = mesh.triangle_count;
    add_fin(&mesh, 5, 0.01);
    add_fin(&mesh, 60, 0.02);
    add_fin(&mesh, count, 0.03); // two fins on one edge
    add_fin(&mesh, 100, 0.01);
    struct repair_report report = repaired(&mesh);
    assert_sound(&report, 1);
    assert_int_equal(4, report.fin_count);
    assert_int_equal(4, report.fin_triangles);
    assert_true(report.fins[0].area_mm2 > 0 && report.fins[0].area_mm2 < 0.1);
    assert_near(vec3_length(report.fins[0].centre), 10, 1);
    assert_int_equal(sound.vertex_count, mesh.vertex_count);
    assert_int_equal(sound.triangle_count, mesh.triangle_count);
    assert_memory_equal(sound.positions, mesh.positions, 12 * sound.vertex_count);
    assert_memory_equal(sound.triangles, mesh.triangles, 12 * sound.triangle_count);
    mesh_fini(&sound);
    mesh_fini(&mesh);
}

static void islands_below_the_share_go_and_are_named(void **state) {
    (void)state;
    struct mesh mesh, small;
    shape_sphere(&mesh, 20, 8);
    static const double radii[] = {1, 2, 2.7, 4}; // shares 0.23 %, 0.9 %, 1.7 %, 3.7 % of its area
    for (int i = 0; i < 4; i++) {
        shape_sphere(&small, radii[i], 4);
        shape_move(&small, (pose){quat_identity(), {40, 20.0 * i, 3}});
        shape_append(&mesh, &small);
        mesh_fini(&small);
    }
    struct repair_report report = repaired(&mesh);
    assert_sound(&report, 2);
    assert_int_equal(3, report.island_count);
    assert_int_equal(3 * 128, report.island_triangles);
    assert_near(mesh_area(&mesh) + report.island_area_mm2, report.area_mm2, 1e-6);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(128, report.islands[i].triangles);
        assert_vec3_near(report.islands[i].centre, ((vec3){40, 20.0 * (2 - i), 3}), 1e-4);
    }
    mesh_fini(&mesh);
}

static void of_dust_alone_the_largest_grain_is_kept(void **state) {
    (void)state;
    struct mesh mesh, grain;
    box_at(&mesh, (vec3){0});
    for (int i = 1; i < 80; i++) {
        shape_box(&grain, (vec3){1, 1, i == 40 ? 1.1 : 1});
        shape_move(&grain, (pose){quat_identity(), {5.0 * i, 0, 0}});
        shape_append(&mesh, &grain);
        mesh_fini(&grain);
    }
    struct repair_report report = repaired(&mesh);
    assert_int_equal(79, report.island_count);
    assert_near(mesh_volume(&mesh), 8.8, 1e-5);
    mesh_fini(&mesh);
}

static void closed_surfaces_that_touch_stay_apart_where_an_open_one_is_welded(void **state) {
    (void)state;
    struct mesh mesh, sheet;
    two_boxes(&mesh, (vec3){2, 0, 0});
    shape_grid(&sheet, 4, 3);
    explode(&sheet, 0, 1);
    shape_append(&mesh, &sheet);
    struct repair_report report = repaired(&mesh);
    assert_int_equal(54 - 16, report.welded_vertices);
    assert_int_equal(0, report.wall_triangles + report.after.non_manifold_edges);
    assert_int_equal(3, report.after.components);
    mesh_fini(&mesh);
    mesh_fini(&sheet);
}

static void a_triangle_without_height_stays_and_is_named(void **state) {
    (void)state;
    struct mesh mesh;
    shape_grid(&mesh, 10, 2);
    uint32_t flat[3] = {0, 1, 2}; // the first row of vertices
    vec3 a = mesh_vertex(&mesh, 0), b = mesh_vertex(&mesh, 1), c = mesh_vertex(&mesh, 2);
    assert_near(vec3_length(vec3_cross(vec3_sub(b, a), vec3_sub(c, a))), 0, 1e-12);
    shape_add_triangles(&mesh, 1, flat);
    struct repair_report report = repaired(&mesh);
    assert_int_equal(9, mesh.triangle_count);
    assert_int_equal(1, report.flat_triangles);
    assert_place(&report, REPAIR_FLAT, (struct box){a, c});
    mesh_fini(&mesh);
}

static void of_nothing_but_repeated_corners_nothing_is_left(void **state) {
    (void)state;
    struct mesh mesh;
    struct repair_report report;
    mesh_init(&mesh, 2, 2);
    memset(mesh.positions, 0, 24);
    memset(mesh.triangles, 0, 24);
    mesh.triangles[1] = 1;
    assert_false(repair_mesh(&mesh, &gentle, &report));
    assert_int_equal(2, report.repeated_corners);
    mesh_fini(&mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sound_mesh_stays_bit_for_bit),
        cmocka_unit_test(a_soup_is_welded_within_the_tolerance_and_no_farther),
        cmocka_unit_test(triangles_turned_at_random_are_turned_back_outwards),
        cmocka_unit_test(each_component_faces_outwards_and_a_void_inwards),
        cmocka_unit_test(an_open_sheet_is_kept_and_its_smaller_part_follows_the_larger),
        cmocka_unit_test(a_surface_of_one_side_stays_and_is_named),
        cmocka_unit_test(bad_triangles_and_unused_vertices_go_and_are_counted),
        cmocka_unit_test(solids_that_share_an_edge_or_a_vertex_are_split_and_nothing_moves),
        cmocka_unit_test(a_wall_between_two_solids_goes_and_they_become_one),
        cmocka_unit_test(of_a_sheet_that_is_there_twice_one_side_is_kept),
        cmocka_unit_test(a_large_fin_stays_and_is_named),
        cmocka_unit_test(small_fins_go_also_those_on_fins_and_the_rest_stays_bit_for_bit),
        cmocka_unit_test(islands_below_the_share_go_and_are_named),
        cmocka_unit_test(of_dust_alone_the_largest_grain_is_kept),
        cmocka_unit_test(closed_surfaces_that_touch_stay_apart_where_an_open_one_is_welded),
        cmocka_unit_test(a_triangle_without_height_stays_and_is_named),
        cmocka_unit_test(of_nothing_but_repeated_corners_nothing_is_left),
    };
    return cmocka_run_group_tests_name("repair", tests, NULL, NULL);
}
