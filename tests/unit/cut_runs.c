#include "cut/cut_mesh.h"
#include "scene/shapes.h"
#include "test.h"
#include "unit/cut_scene.h"

#include <string.h>

// ---- ids ----

static void assert_ascending(const uint32_t *ids, uint32_t count) {
    for (uint32_t i = 1; i < count; i++)
        assert_true(ids[i - 1] < ids[i]);
}

static void assert_triangles_told(const struct picture *before, const struct picture *after,
                                  const struct cut_change *change) {
    static const uint32_t none[3] = {MESH_NONE, MESH_NONE, MESH_NONE};
    for (uint32_t t = 0; t < after->triangle_bound; t++) {
        const uint32_t *was = t < before->triangle_bound ? before->corners + 3 * t : none;
        const uint32_t *is = after->corners + 3 * t;
        bool gone = was[0] != MESH_NONE && is[0] == MESH_NONE;
        bool other = is[0] != MESH_NONE && memcmp(was, is, sizeof none);
        assert_int_equal(contains(change->freed, change->freed_count, t), gone);
        assert_int_equal(contains(change->made, change->made_count, t), other);
        if (is[0] != MESH_NONE && !other)
            assert_int_equal(after->labels[t], before->labels[t]);
    }
}

static void assert_vertices_told(const struct picture *before, const struct picture *after,
                                 uint32_t original_count, const struct cut_change *change) {
    for (uint32_t v = 0; v < after->vertex_bound; v++) {
        bool was = v < before->vertex_bound && before->vertex_alive[v];
        bool is_new = after->vertex_alive[v] && !was;
        assert_int_equal(contains(change->vertices, change->vertex_count, v), is_new);
        if (is_new)
            assert_true(v >= original_count);
        if (was && after->vertex_alive[v]) // none is ever moved
            assert_memory_equal(&after->points[v], &before->points[v], sizeof(vec3));
    }
}

static void a_change_tells_all_that_has_changed(void **state) {
    (void)state;
    struct random r = {11};
    struct cut_mesh *mesh = sphere(10, 14);
    uint32_t original_count = cut_mesh_vertex_bound(mesh), number = 0;
    for (int i = 0; i < 60; i++) {
        struct convex parts[3];
        for (int k = 0; k < 3; k++)
            parts[k] = random_bite(&r, mesh, 2.5);
        struct picture before = take_picture(mesh);
        struct cut_change change;
        assert_int_equal(cut_apply(mesh, parts, 1 + i % 3, &change, NULL), CUT_CHANGED);
        struct picture after = take_picture(mesh);
        assert_int_equal(change.number, ++number);
        assert_ascending(change.freed, change.freed_count);
        assert_ascending(change.made, change.made_count);
        assert_ascending(change.vertices, change.vertex_count);
        assert_triangles_told(&before, &after, &change);
        assert_vertices_told(&before, &after, original_count, &change);
        drop_picture(&before);
        drop_picture(&after);
        cut_change_fini(&change);
    }
    cut_mesh_destroy(&mesh);
}

// On flat faces, where none of them shapes anything: what is outside of all blades stays.
static void original_vertices_go_with_what_is_cut_only(void **state) {
    (void)state;
    struct random r = {15};
    struct mesh octahedron;
    shape_sphere(&octahedron, 10, 12);
    for (uint32_t v = 0; v < octahedron.vertex_count; v++) {
        vec3 p = mesh_vertex(&octahedron, v);
        mesh_set_vertex(&octahedron, v, vec3_scale(10 / (fabs(p.x) + fabs(p.y) + fabs(p.z)), p));
    }
    uint32_t original_count = octahedron.vertex_count, alive = 0;
    struct cut_mesh *mesh = cut_mesh_of(&octahedron);
    struct convex blades[20];
    for (int i = 0; i < 20; i++) {
        blades[i] = random_bite(&r, mesh, 1.5);
        struct cut_change change = cut(mesh, blades[i]);
        assert_int_equal(change.piece_count, 0);
        cut_change_fini(&change);
    }
    for (uint32_t v = 0; v < original_count; v++) {
        bool inside = false;
        for (int i = 0; i < 20; i++)
            inside |= convex_contains(&blades[i], cut_mesh_vertex(mesh, v));
        assert_int_equal(cut_mesh_vertex_alive(mesh, v), !inside);
        alive += !inside;
    }
    assert_in_range(alive, original_count / 2, original_count - 20);
    cut_mesh_destroy(&mesh);
}

// A tunnel, bored in small steps: nearly each bite takes the surface of the one before.
static void ids_of_a_cut_are_used_again(void **state) {
    (void)state;
    struct random r = {12};
    struct cut_mesh *mesh = sphere(10, 14);
    uint32_t most = 0, made = 0;
    for (int i = 0; i < 200; i++) {
        struct convex blade = random_convex(&r, (vec3){0, 0, 12 - i * 0.04}, 3);
        struct cut_change change;
        if (cut_apply(mesh, &blade, 1, &change, NULL) != CUT_CHANGED)
            continue;
        uint32_t count = cut_mesh_triangle_count(mesh);
        most = count > most ? count : most;
        made += change.made_count;
        cut_change_fini(&change);
    }
    assert_true(made > 5 * most);
    assert_true(cut_mesh_triangle_bound(mesh) < most + most / 2);
    assert_true(cut_mesh_vertex_bound(mesh) < most);
    cut_mesh_destroy(&mesh);
}

static void a_copy_goes_on_with_the_same_bits(void **state) {
    (void)state;
    struct random r = {13};
    struct cut_mesh *mesh = sphere(10, 14);
    for (int i = 0; i < 40; i++) {
        struct cut_mesh *copy = cut_mesh_copy(mesh);
        struct convex blade = random_bite(&r, mesh, 2);
        struct cut_change a, b;
        enum cut_outcome outcome = cut_apply(mesh, &blade, 1, &a, NULL);
        assert_int_equal(cut_apply(copy, &blade, 1, &b, NULL), outcome);
        assert_same(mesh, copy);
        if (outcome == CUT_CHANGED) {
            assert_memory_equal(&a.volume_mm3, &b.volume_mm3, sizeof a.volume_mm3);
            cut_change_fini(&a);
            cut_change_fini(&b);
        }
        cut_mesh_destroy(&copy);
    }
    cut_mesh_destroy(&mesh);
}

// ---- long runs ----

static void bites_add_up_and_keep_the_mesh_sound(void **state) {
    (void)state;
    struct random r = {17};
    for (int shape = 0; shape < 3; shape++) {
        struct mesh start;
        if (shape == 0)
            shape_bumpy(&start, (vec3){12, 9, 7}, 1.5, 16, 4);
        else if (shape == 1)
            shape_torus(&start, 10, 3, 40, 16);
        else
            shape_box(&start, (vec3){7, 6, 5});
        struct cut_mesh *mesh = cut_mesh_of(&start);
        for (int i = 0; i < 60; i++) {
            double before = cut_mesh_volume(mesh);
            struct convex parts[2] = {random_bite(&r, mesh, 2), random_bite(&r, mesh, 2)};
            struct cut_change change;
            enum cut_outcome outcome = cut_apply(mesh, parts, 1 + i % 2, &change, NULL);
            assert_int_not_equal(outcome, CUT_REFUSED);
            if (outcome != CUT_CHANGED)
                continue;
            double after = cut_mesh_volume(mesh), pieces = 0;
            for (int k = 0; k < change.piece_count; k++)
                pieces += change.pieces[k].volume;
            assert_near(change.volume_mm3, after, 1e-8 * before);
            assert_near(before, after + change.removed_mm3 + pieces, 1e-3);
            assert_true(change.removed_mm3 <= (parts[0].volume + parts[1].volume) * (1 + 1e-6));
            sound_topology(mesh);
            cut_change_fini(&change);
        }
        cut_mesh_destroy(&mesh);
    }
}

// Many bites on a lattice: what is left are boxes, so few triangles are enough.
static void flat_surface_does_not_pile_up_triangles(void **state) {
    (void)state;
    struct random r = {18};
    struct cut_mesh *mesh = cube(5);
    for (int i = 0; i < 100; i++) {
        vec3 low = {(double)(random_bits(&r) % 9) - 5, (double)(random_bits(&r) % 9) - 5, 3};
        struct convex blade = box(low, (vec3){low.x + 1.5, low.y + 1.5, 6});
        struct cut_change change;
        if (cut_apply(mesh, &blade, 1, &change, NULL) == CUT_CHANGED)
            cut_change_fini(&change);
    }
    sound_topology(mesh);
    assert_true(cut_mesh_triangle_count(mesh) < 800);
    cut_mesh_destroy(&mesh);
}

// ---- cavities ----

static uint32_t pieces_of(struct cut_change change) {
    uint32_t count = (uint32_t)change.piece_count;
    cut_change_fini(&change);
    return count;
}

// A mesh that may have cavities pays for it with each piece.
static void a_cavity_that_is_open_is_one_no_more(void **state) {
    (void)state;
    struct cut_mesh *mesh = cube(5);
    pieces_of(cut(mesh, box((vec3){-1, -1, -1}, (vec3){1, 1, 1})));
    assert_true(mesh->hollow);
    assert_int_equal(pieces_of(cut(mesh, box((vec3){3, -6, -6}, (vec3){3.2, 6, 6}))), 1);
    assert_true(mesh->hollow);
    pieces_of(cut(mesh, box((vec3){-0.5, -0.5, 0}, (vec3){0.5, 0.5, 6})));
    assert_int_equal(pieces_of(cut(mesh, box((vec3){2, -6, -6}, (vec3){2.2, 6, 6}))), 1);
    assert_false(mesh->hollow);
    sound_topology(mesh);
    cut_mesh_destroy(&mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_change_tells_all_that_has_changed),
        cmocka_unit_test(original_vertices_go_with_what_is_cut_only),
        cmocka_unit_test(ids_of_a_cut_are_used_again),
        cmocka_unit_test(a_copy_goes_on_with_the_same_bits),
        cmocka_unit_test(bites_add_up_and_keep_the_mesh_sound),
        cmocka_unit_test(a_cavity_that_is_open_is_one_no_more),
        cmocka_unit_test(flat_surface_does_not_pile_up_triangles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
