#include "cut/cut.h"

#include "scene/shapes.h"
#include "test.h"
#include "unit/cut_scene.h"

#include <string.h>

// ---- bites whose outcome is known ----

struct bite {
    const char *what;
    vec3 low, high;
    double removed, area; // of a cube from -5 to 5; the area after it
    int64_t genus;
    uint32_t components;
    int pieces;
    double piece;
};

static const struct bite bites[] = {
    {"inside", {-1, -1, -1}, {1, 1, 2}, 12, 600 + 32, 0, 2, 0, 0},
    {"out of a face", {-1, -1, 3}, {1, 1, 8}, 8, 600 + 16, 0, 1, 0, 0},
    {"off an edge", {3, -1, 3}, {8, 1, 8}, 8, 600 + 8 - 8 + 8, 0, 1, 0, 0},
    {"off a corner", {4, 4, 4}, {6, 6, 6}, 1, 600, 0, 1, 0, 0},
    {"through", {-1, -2, -6}, {1, 2, 6}, 80, 600 - 16 + 120, 1, 1, 0, 0},
    {"a whole side", {-6, -6, 3}, {6, 6, 6}, 200, 600 - 80, 0, 1, 0, 0},
    {"in two", {2, -6, -6}, {3, 6, 6}, 100, 480, 0, 1, 1, 200},
    {"flush with a face", {-1, -1, 3}, {1, 1, 5}, 8, 600 + 16, 0, 1, 0, 0},
    {"flush with three faces", {4, 4, 4}, {5, 5, 5}, 1, 600, 0, 1, 0, 0},
    {"flush with two faces, through", {4, 4, -5}, {5, 5, 5}, 10, 598, 0, 1, 0, 0},
    {"flush, in two", {2, -5, -5}, {3, 5, 5}, 100, 480, 0, 1, 1, 200},
};

static void bites_take_what_they_hold(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof bites / sizeof *bites; i++) {
        const struct bite *b = &bites[i];
        struct cut_mesh *mesh = cube(5);
        struct cut_change change = cut(mesh, box(b->low, b->high));
        struct topology topology = sound_topology(mesh);
        if (topology.genus != b->genus || topology.components != b->components)
            fail_msg("%s: genus %ld, %u components", b->what, (long)topology.genus,
                     topology.components);
        assert_near(change.removed_mm3, b->removed, 1e-4);
        assert_near(change.volume_mm3, 1000 - b->removed - b->piece, 1e-4);
        assert_near(cut_mesh_volume(mesh), change.volume_mm3, 1e-9);
        assert_near(area_of(mesh), b->area, 1e-3);
        assert_int_equal(change.piece_count, b->pieces);
        if (b->pieces)
            assert_near(change.pieces[0].volume, b->piece, 1e-4);
        cut_change_fini(&change);
        cut_mesh_destroy(&mesh);
    }
}

// Bites flush beside each other and over each other: no skin between them, no fin, no step.
static void flush_bites_leave_nothing_between_them(void **state) {
    (void)state;
    struct cut_mesh *mesh = cube(5);
    for (int x = -3; x < 3; x++)
        for (int y = -2; y < 2; y++) {
            struct cut_change change = cut(mesh, box((vec3){x, y, 3}, (vec3){x + 1, y + 1, 5}));
            assert_near(change.removed_mm3, 2, 1e-4);
            cut_change_fini(&change);
        }
    sound_topology(mesh);
    assert_near(cut_mesh_volume(mesh), 1000 - 48, 1e-4);
    assert_near(area_of(mesh), 600 + 2 * 2 * (6 + 4), 1e-3);
    assert_true(cut_mesh_triangle_count(mesh) < 200);
    cut_mesh_destroy(&mesh);
}

static void a_bite_again_takes_nothing(void **state) {
    (void)state;
    struct random r = {3};
    struct cut_mesh *mesh = sphere(10, 20);
    for (int i = 0; i < 30; i++) {
        struct convex blade = random_bite(&r, mesh, 2);
        struct cut_change change;
        struct error err;
        if (cut_apply(mesh, &blade, 1, &change, &err) != CUT_CHANGED)
            continue;
        cut_change_fini(&change);
        struct cut_mesh *before = cut_mesh_copy(mesh);
        assert_int_equal(cut_apply(mesh, &blade, 1, &change, &err), CUT_NOTHING);
        assert_same(mesh, before);
        cut_mesh_destroy(&before);
    }
    cut_mesh_destroy(&mesh);
}

static void what_touches_nothing_changes_nothing(void **state) {
    (void)state;
    struct cut_mesh *mesh = cube(5);
    const struct convex blades[] = {box((vec3){50, 0, 0}, (vec3){51, 1, 1}),
                                    box((vec3){5.5, 5.5, 5.5}, (vec3){6, 6, 6}),
                                    box((vec3){5, -1, -1}, (vec3){6, 1, 1}), // touches a face
                                    box((vec3){4.97, 4.97, 4.97}, (vec3){6, 6, 6})}; // 2.7e-5 mm³
    struct cut_change change;
    struct error err;
    for (int i = 0; i < 4; i++)
        assert_int_equal(cut_apply(mesh, &blades[i], 1, &change, &err), CUT_NOTHING);
    assert_int_equal(cut_apply(mesh, blades, 0, &change, &err), CUT_NOTHING);
    struct cut_mesh *fresh = cube(5);
    assert_same(mesh, fresh);
    cut_mesh_destroy(&fresh);
    cut_mesh_destroy(&mesh);
}

// ---- unions ----

static void parts_that_overlap_take_their_union(void **state) {
    (void)state;
    const struct convex whole = box((vec3){-2, -1, 2}, (vec3){2, 1, 7});
    const struct convex parts[2][2] = {
        {box((vec3){-2, -1, 2}, (vec3){1, 1, 7}),
         box((vec3){-1, -1, 2}, (vec3){2, 1, 7})}, // overlap
        {box((vec3){-2, -1, 2}, (vec3){0, 1, 7}), box((vec3){0, -1, 2}, (vec3){2, 1, 7})}}; // touch
    for (int i = 0; i < 2; i++) {
        struct cut_mesh *one = cube(5), *two = cube(5);
        struct cut_change as_one = cut(one, whole), as_two;
        assert_int_equal(cut_apply(two, parts[i], 2, &as_two, NULL), CUT_CHANGED);
        assert_near(as_two.removed_mm3, as_one.removed_mm3, 1e-4);
        assert_near(area_of(two), area_of(one), 1e-3);
        assert_int_equal(as_two.number, 1);
        assert_int_equal(as_two.patch_count, 1);
        assert_near(as_two.patches[0].area, as_one.patches[0].area, 1e-3);
        assert_vec3_near(as_two.patches[0].centroid, as_one.patches[0].centroid, 1e-3);
        sound_topology(two);
        cut_change_fini(&as_one);
        cut_change_fini(&as_two);
        cut_mesh_destroy(&one);
        cut_mesh_destroy(&two);
    }
}

static void a_union_that_takes_all_is_refused_and_changes_nothing(void **state) {
    (void)state;
    struct random r = {8};
    struct cut_mesh *mesh = sphere(10, 12);
    const struct convex halves[2] = {box((vec3){-11, -11, -11}, (vec3){0.3, 11, 11}),
                                     box((vec3){0.2, -11, -11}, (vec3){11, 11, 11})};
    for (int i = 0; i < 10; i++) {
        struct cut_mesh *before = cut_mesh_copy(mesh);
        struct cut_change change;
        struct error err;
        assert_int_equal(cut_apply(mesh, halves, 2, &change, &err), CUT_REFUSED);
        assert_non_null(strstr(err.text, "all that there is"));
        assert_same(mesh, before);
        struct convex blade = random_bite(&r, mesh, 3); // goes on as if nothing had been
        enum cut_outcome outcome = cut_apply(mesh, &blade, 1, &change, &err);
        if (outcome == CUT_CHANGED)
            cut_change_fini(&change);
        assert_int_equal(cut_apply(before, &blade, 1, &change, &err), outcome);
        if (outcome == CUT_CHANGED)
            cut_change_fini(&change);
        assert_same(mesh, before);
        cut_mesh_destroy(&before);
    }
    cut_mesh_destroy(&mesh);
}

// ---- surfaces ----

static bool lies_on_cube(vec3 p, double half) {
    double farthest = fmax(fabs(p.x), fmax(fabs(p.y), fabs(p.z)));
    return fabs(farthest - half) < 1e-5;
}

static void labels_tell_new_surface_from_old(void **state) {
    (void)state;
    struct random r = {14};
    struct cut_mesh *mesh = cube(5);
    for (int i = 0; i < 20; i++) {
        struct convex blade = random_bite(&r, mesh, 2);
        struct cut_change change;
        if (cut_apply(mesh, &blade, 1, &change, NULL) != CUT_CHANGED)
            continue;
        for (uint32_t t = 0; t < cut_mesh_triangle_bound(mesh); t++) {
            if (!cut_mesh_triangle_alive(mesh, t))
                continue;
            const uint32_t *c = cut_mesh_triangle(mesh, t);
            vec3 middle = {0};
            for (int k = 0; k < 3; k++)
                middle = vec3_add_scaled(middle, 1.0 / 3, cut_mesh_vertex(mesh, c[k]));
            assert_true(cut_mesh_label(mesh, t) <= change.number);
            assert_int_equal(cut_mesh_label(mesh, t) == 0, lies_on_cube(middle, 5));
            if (cut_mesh_label(mesh, t) == change.number)
                assert_true(contains(change.made, change.made_count, t));
        }
        cut_change_fini(&change);
    }
    cut_mesh_destroy(&mesh);
}

static void patches_are_parts_of_the_new_surface(void **state) {
    (void)state;
    struct cut_mesh *mesh = cube(5);
    struct cut_change change = cut(mesh, box((vec3){-1, -6, 4}, (vec3){1, 6, 6})); // a groove
    assert_int_equal(change.patch_count, 1);
    assert_near(change.patches[0].area, 40, 1e-4);
    assert_vec3_near(change.patches[0].centroid, ((vec3){0, 0, 4.25}), 1e-4);
    assert_near(change.patches[0].extent, sqrt(1 + 25 + 0.75 * 0.75), 1e-4);
    cut_change_fini(&change);
    change = cut(mesh, box((vec3){-6, 2, 3}, (vec3){6, 3, 6})); // across it, and deeper
    assert_int_equal(change.patch_count, 1);
    cut_change_fini(&change);
    change = cut(mesh, box((vec3){-6, 2.25, 1}, (vec3){6, 2.75, 3.5})); // deeper still
    assert_near(change.removed_mm3, 0.5 * 2 * 10, 1e-4);
    assert_near(change.patches[0].area, 2 * 2 * 10 + 0.5 * 10, 1e-4);
    cut_change_fini(&change);
    const struct convex apart[2] = {box((vec3){-4, -4, -6}, (vec3){-3, -3, -4}),
                                    box((vec3){3, 3, -6}, (vec3){4, 4, -4})};
    assert_int_equal(cut_apply(mesh, apart, 2, &change, NULL), CUT_CHANGED);
    assert_int_equal(change.patch_count, 2);
    for (int i = 0; i < 2; i++)
        assert_near(change.patches[i].area, 5, 1e-4);
    cut_change_fini(&change);
    cut_mesh_destroy(&mesh);
}

// ---- pieces ----

static void a_piece_is_whole_and_where_it_was(void **state) {
    (void)state;
    struct cut_mesh *mesh = cube(5);
    const struct convex cross[2] = {box((vec3){2, -6, -6}, (vec3){3, 6, 6}),
                                    box((vec3){-6, 1, -6}, (vec3){6, 2, 6})};
    struct cut_change change;
    assert_int_equal(cut_apply(mesh, cross, 2, &change, NULL), CUT_CHANGED);
    assert_int_equal(change.piece_count, 3); // 7 x 6 x 10 stays
    assert_near(change.volume_mm3, 420, 1e-4);
    double volume = change.volume_mm3 + change.removed_mm3;
    for (int i = 0; i < 3; i++) {
        struct cut_piece *piece = &change.pieces[i];
        struct topology topology = topology_of(&piece->mesh);
        assert_true(topology.closed && topology.manifold && topology.oriented);
        assert_int_equal(topology.components, 1);
        assert_int_equal(topology.unused_vertices, 0);
        assert_near(mesh_volume(&piece->mesh), piece->volume, 1e-4);
        struct box bounds = mesh_bounds(&piece->mesh);
        assert_vec3_near(piece->centroid, vec3_lerp(bounds.min, bounds.max, 0.5), 1e-4);
        volume += piece->volume;
    }
    assert_near(volume, 1000, 1e-4);
    assert_int_equal(sound_topology(mesh).components, 1);
    cut_change_fini(&change);
    cut_mesh_destroy(&mesh);
}

static void a_cavity_goes_with_the_piece_around_it(void **state) {
    (void)state;
    struct cut_mesh *mesh = cube(5);
    const struct convex holes[2] = {box((vec3){3.5, 0, 0}, (vec3){4.5, 1, 1}),
                                    box((vec3){-3, 0, 0}, (vec3){-1, 1, 1})};
    struct cut_change change;
    assert_int_equal(cut_apply(mesh, holes, 2, &change, NULL), CUT_CHANGED);
    assert_int_equal(change.piece_count, 0);
    cut_change_fini(&change);
    change = cut(mesh, box((vec3){2, -6, -6}, (vec3){3, 6, 6}));
    assert_int_equal(change.piece_count, 1);
    assert_near(change.pieces[0].volume, 199, 1e-4);
    assert_near(mesh_volume(&change.pieces[0].mesh), 199, 1e-3);
    assert_near(change.volume_mm3, 698, 1e-4);
    assert_int_equal(sound_topology(mesh).components, 2);
    cut_change_fini(&change);
    cut_mesh_destroy(&mesh);
}

// ---- meshes that cannot be cut ----

static void only_a_solid_that_faces_outwards_is_taken(void **state) {
    (void)state;
    struct mesh shape;
    struct cut_mesh *mesh;
    struct error err;
    shape_grid(&shape, 5, 3);
    assert_int_equal(cut_mesh_create(&shape, &mesh, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "open"));
    assert_null(mesh);
    mesh_fini(&shape);
    shape_box(&shape, (vec3){1, 1, 1});
    for (uint32_t t = 0; t < shape.triangle_count; t++) {
        uint32_t *v = shape.triangles + 3 * t, b = v[1];
        v[1] = v[2];
        v[2] = b;
    }
    assert_int_equal(cut_mesh_create(&shape, &mesh, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "inwards"));
    uint32_t b = shape.triangles[1];
    shape.triangles[1] = shape.triangles[2];
    shape.triangles[2] = b;
    assert_int_equal(cut_mesh_create(&shape, &mesh, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "face different ways"));
    shape.positions[4] = NAN;
    assert_int_equal(cut_mesh_create(&shape, &mesh, &err), RESULT_INVALID);
    mesh_fini(&shape);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bites_take_what_they_hold),
        cmocka_unit_test(flush_bites_leave_nothing_between_them),
        cmocka_unit_test(a_bite_again_takes_nothing),
        cmocka_unit_test(what_touches_nothing_changes_nothing),
        cmocka_unit_test(parts_that_overlap_take_their_union),
        cmocka_unit_test(a_union_that_takes_all_is_refused_and_changes_nothing),
        cmocka_unit_test(labels_tell_new_surface_from_old),
        cmocka_unit_test(patches_are_parts_of_the_new_surface),
        cmocka_unit_test(a_piece_is_whole_and_where_it_was),
        cmocka_unit_test(a_cavity_goes_with_the_piece_around_it),
        cmocka_unit_test(only_a_solid_that_faces_outwards_is_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
