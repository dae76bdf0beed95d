#include "mesh/convex.h"

#include "random.h"
#include "test.h"

#include <string.h>

static const struct plane cube[6] = {{{1, 0, 0}, 1},  {{-1, 0, 0}, 1}, {{0, 1, 0}, 1},
                                     {{0, -1, 0}, 1}, {{0, 0, 1}, 1},  {{0, 0, -1}, 1}};

// Every face is a loop on its plane, every edge has both faces, nothing sticks out of a plane.
static void assert_is_whole(const struct convex *c) {
    assert_int_equal(c->vertex_count - c->edge_count + c->plane_count, 2);
    assert_int_equal(c->first_corner[0], 0);
    assert_int_equal(c->first_corner[c->plane_count], 2 * c->edge_count);
    for (int f = 0; f < c->plane_count; f++) {
        assert_true(c->first_corner[f + 1] - c->first_corner[f] >= 3);
        for (int i = c->first_corner[f]; i < c->first_corner[f + 1]; i++)
            assert_near(vec3_dot(c->planes[f].normal, c->vertices[c->corners[i]]),
                        c->planes[f].offset, 1e-6);
        for (int v = 0; v < c->vertex_count; v++)
            assert_true(vec3_dot(c->planes[f].normal, c->vertices[v]) <=
                        c->planes[f].offset + 1e-6);
    }
    for (int e = 0; e < c->edge_count; e++) {
        const struct convex_edge *edge = &c->edges[e];
        vec3 along = vec3_sub(c->vertices[edge->ends[1]], c->vertices[edge->ends[0]]);
        vec3 out = vec3_add(c->planes[edge->left].normal, c->planes[edge->right].normal);
        vec3 to_left = vec3_cross(out, along);
        assert_true(vec3_dot(to_left, c->planes[edge->right].normal) <
                    vec3_dot(to_left, c->planes[edge->left].normal) + 1e-9);
    }
}

static void a_cube_has_its_corners_and_volume(void **state) {
    (void)state;
    struct convex c;
    assert_int_equal(convex_create(cube, 6, &c, NULL), RESULT_OK);
    assert_int_equal(c.vertex_count, 8);
    assert_int_equal(c.edge_count, 12);
    assert_near(c.volume, 8, 1e-12);
    assert_vec3_near(c.box.min, ((vec3){-1, -1, -1}), 1e-12);
    assert_vec3_near(c.box.max, ((vec3){1, 1, 1}), 1e-12);
    assert_is_whole(&c);
}

static int random_planes(struct random *r, struct plane *planes) {
    vec3 centre = random_in_box(r, 40);
    int count = 20 + (int)random_between(r, 0, 45);
    for (int i = 0; i < count; i++) {
        planes[i].normal = random_direction(r);
        planes[i].offset = vec3_dot(planes[i].normal, centre) + random_between(r, 1, 3);
    }
    return count;
}

static void random_planes_enclose_what_they_have_in_common(void **state) {
    (void)state;
    struct random r = {1};
    for (int round = 0; round < 200; round++) {
        struct plane planes[CONVEX_PLANES_MAX];
        int count = random_planes(&r, planes);
        struct convex c;
        if (convex_create(planes, count, &c, NULL) != RESULT_OK)
            continue; // open: every normal may look to one half of space
        assert_is_whole(&c);
        vec3 size = vec3_sub(c.box.max, c.box.min);
        int hits = 0, tries = 2000;
        for (int i = 0; i < tries; i++) {
            vec3 p = {random_between(&r, c.box.min.x, c.box.max.x),
                      random_between(&r, c.box.min.y, c.box.max.y),
                      random_between(&r, c.box.min.z, c.box.max.z)};
            bool inside = true;
            for (int k = 0; k < count; k++)
                inside &= vec3_dot(planes[k].normal, p) <= planes[k].offset;
            assert_int_equal(convex_contains(&c, p), inside);
            hits += inside;
        }
        double share = c.volume / (size.x * size.y * size.z);
        assert_near((double)hits / tries, share, 5 * sqrt(share * (1 - share) / tries));
    }
}

// A plane through corners, along edges or in a face: the same body, no face without an area.
static void planes_that_touch_only_leave_the_cube(void **state) {
    (void)state;
    static const struct plane touching[] = {
        {{1, 1, 1}, 3}, {{1, 1, 0}, 2}, {{2, 0, 0}, 2}, {{0, 0, 1}, 1 + 1e-9}, {{1, 0, 0}, 7}};
    for (int i = 0; i < 5; i++) {
        struct plane planes[7];
        memcpy(planes, cube, sizeof cube);
        planes[6] = touching[i];
        struct convex c;
        assert_int_equal(convex_create(planes, 7, &c, NULL), RESULT_OK);
        assert_int_equal(c.plane_count, 6);
        assert_near(c.volume, 8, 1e-6);
        assert_is_whole(&c);
    }
}

// Through vertices on purpose: each corner is cut off at the middles of its edges.
static void a_cuboctahedron_has_corners_of_four_faces(void **state) {
    (void)state;
    struct plane planes[14];
    memcpy(planes, cube, sizeof cube);
    for (int i = 0; i < 8; i++)
        planes[6 + i] = (struct plane){{i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1}, 2};
    struct convex c;
    assert_int_equal(convex_create(planes, 14, &c, NULL), RESULT_OK);
    assert_int_equal(c.vertex_count, 12);
    assert_int_equal(c.plane_count, 14);
    assert_near(c.volume, 8 * 5 / 6.0, 1e-9);
    assert_is_whole(&c);
}

static void supports_hold_all_points(void **state) {
    (void)state;
    struct random r = {4};
    vec3 points[30], normals[40];
    struct plane planes[40];
    for (int i = 0; i < 30; i++)
        points[i] = random_in_box(&r, 5);
    for (int i = 0; i < 40; i++)
        normals[i] = random_direction(&r);
    convex_supports(points, 30, normals, 40, planes);
    for (int i = 0; i < 40; i++) {
        double farthest = -INFINITY;
        for (int k = 0; k < 30; k++)
            farthest = fmax(farthest, vec3_dot(normals[i], points[k]));
        assert_near(planes[i].offset, farthest, 0);
    }
}

static void planes_without_a_polyhedron_are_refused(void **state) {
    (void)state;
    static const struct {
        int plane;
        struct plane with;
        const char *says;
    } rows[] = {
        {0, {{1, 0, 0}, -2}, "cuts away"},         {3, {{0, -1, 0}, NAN}, "not finite"},
        {3, {{0, -INFINITY, 0}, 1}, "not finite"}, {5, {{0, 0, 0}, 1}, "without length"},
        {5, {{0, 0, 1}, 1}, "within 100 m"},        {1, {{-1, 0, 0}, -1 + 1e-8}, "cuts away"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct plane planes[6];
        memcpy(planes, cube, sizeof cube);
        planes[rows[i].plane] = rows[i].with;
        struct convex c;
        struct error err = {0};
        assert_int_equal(convex_create(planes, 6, &c, &err), RESULT_INVALID);
        assert_non_null(strstr(err.text, rows[i].says));
    }
    struct plane inwards[6];
    for (int i = 0; i < 6; i++)
        inwards[i] = (struct plane){vec3_scale(-1, cube[i].normal), -1};
    struct convex c;
    assert_int_equal(convex_create(inwards, 6, &c, NULL), RESULT_INVALID);
    assert_int_equal(convex_create(cube, 3, &c, NULL), RESULT_INVALID);
}

static void its_own_planes_make_it_again(void **state) {
    (void)state;
    struct random r = {2};
    for (int round = 0; round < 200; round++) {
        struct plane planes[CONVEX_PLANES_MAX];
        int count = random_planes(&r, planes);
        for (int i = 0; i < count; i++) {
            double scale = random_between(&r, 0.1, 9);
            planes[i].normal = vec3_scale(scale, planes[i].normal);
            planes[i].offset *= scale;
        }
        struct convex c, again;
        assert_int_equal(convex_create(planes, count, &c, NULL), RESULT_OK);
        assert_int_equal(convex_create(c.planes, c.plane_count, &again, NULL), RESULT_OK);
        assert_int_equal(again.plane_count, c.plane_count);
        assert_memory_equal(again.planes, c.planes, sizeof c.planes);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cube_has_its_corners_and_volume),
        cmocka_unit_test(random_planes_enclose_what_they_have_in_common),
        cmocka_unit_test(planes_that_touch_only_leave_the_cube),
        cmocka_unit_test(a_cuboctahedron_has_corners_of_four_faces),
        cmocka_unit_test(supports_hold_all_points),
        cmocka_unit_test(planes_without_a_polyhedron_are_refused),
        cmocka_unit_test(its_own_planes_make_it_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
