#include "mesh/query.h"

#include "base/check.h"
#define WIDE 4
#define WIDE_TARGET
#include "mesh/query_search.h"
#include "random.h"
#include "scene/brute.h"
#include "scene/shapes.h"
#include "test.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// Every triangle in turn; the search must find exactly this.
static struct closest closest_of_all(const struct mesh *mesh, vec3 p) {
    struct closest best = {.distance = INFINITY};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        struct closest c;
        closest_on_triangle(mesh, t, p, &c);
        if (c.distance < best.distance)
            best = c;
    }
    return best;
}

// ---- helpers ----

static struct query *create(const struct mesh *mesh) {
    struct query *query = NULL;
    struct error err;
    if (query_create(mesh, &query, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return query;
}

static bool same_bits(const struct closest *a, const struct closest *b) {
    return !memcmp(&a->distance, &b->distance, sizeof a->distance) &&
           !memcmp(&a->point, &b->point, sizeof a->point) && a->triangle == b->triangle &&
           !memcmp(a->weights, b->weights, sizeof a->weights) && a->feature == b->feature &&
           a->corner == b->corner;
}

static void assert_consistent(const struct mesh *mesh, vec3 p, const struct closest *c) {
    assert_true(c->triangle < mesh->triangle_count);
    assert_true(isfinite(c->distance) && c->distance >= 0 && vec3_is_finite(c->point));
    vec3 sum = {0};
    for (int i = 0; i < 3; i++) {
        assert_true(c->weights[i] >= 0 && c->weights[i] <= 1);
        sum = vec3_add_scaled(sum, c->weights[i], mesh_corner(mesh, c->triangle, i));
    }
    assert_near(c->weights[0] + c->weights[1] + c->weights[2], 1, 1e-14);
    assert_vec3_near(sum, c->point, 1e-12 * (1 + vec3_length(c->point)));
    assert_near(vec3_distance(p, c->point), c->distance, 1e-12 * (1 + c->distance));
    int next = (c->corner + 1) % 3, last = (c->corner + 2) % 3;
    assert_true(c->corner >= 0 && c->corner < 3);
    if (c->feature != FEATURE_FACE)
        assert_true(c->weights[last] == 0);
    if (c->feature == FEATURE_VERTEX)
        assert_true(c->weights[c->corner] == 1 && c->weights[next] == 0);
}

// The same answer with no hint, the best, bad ones and one that is not a triangle's.
static struct closest ask(const struct query *query, const struct mesh *mesh, vec3 p,
                          struct random *r) {
    struct closest answer, other;
    assert_true(query_closest(query, p, INFINITY, MESH_NONE, &answer));
    uint32_t hints[] = {answer.triangle, (uint32_t)(random_bits(r) % mesh->triangle_count), 0,
                        mesh->triangle_count - 1, mesh->triangle_count};
    for (size_t i = 0; i < sizeof hints / sizeof hints[0]; i++) {
        assert_true(query_closest(query, p, INFINITY, hints[i], &other));
        assert_true(same_bits(&answer, &other));
    }
    return answer;
}

static void assert_right(const struct query *query, const struct mesh *mesh, vec3 p,
                         struct random *r) {
    struct closest answer = ask(query, mesh, p, r), best = closest_of_all(mesh, p);
    assert_consistent(mesh, p, &answer);
    if (!same_bits(&answer, &best))
        fail_msg("found triangle %u at %.17g, but %u at %.17g", answer.triangle, answer.distance,
                 best.triangle, best.distance);
    assert_near(answer.distance, brute_distance(mesh, p), 1e-9);
}

// ---- what is asked ----

static void answers_agree_with_every_triangle_tried(void **state) {
    (void)state;
    struct random r = {1};
    for (int shape = 0; shape < 4; shape++) {
        struct mesh mesh;
        if (shape == 0)
            shape_bumpy(&mesh, (vec3){40, 30, 25}, 3, 12, 7);
        else if (shape == 1)
            shape_torus(&mesh, 20, 6, 40, 20);
        else if (shape == 2)
            shape_box(&mesh, (vec3){10, 20, 30});
        else
            shape_grid(&mesh, 30, 20);
        shape_move(&mesh, random_pose(&r, 100));
        struct query *query = create(&mesh);
        vec3 middle = mesh_vertex(&mesh, 0);
        for (int i = 0; i < 300; i++)
            assert_right(query, &mesh, vec3_add(middle, random_in_box(&r, i % 2 ? 60 : 5)), &r);
        query_destroy(&query);
        assert_null(query);
        mesh_fini(&mesh);
    }
}

// Points around one triangle whose closest feature is known from how they were made.
static void faces_edges_and_vertices_are_told_apart(void **state) {
    (void)state;
    struct random r = {2};
    for (int i = 0; i < 300; i++) {
        struct mesh mesh;
        mesh_init(&mesh, 3, 1);
        for (uint32_t v = 0; v < 3; v++) {
            mesh.triangles[v] = v;
            mesh_set_vertex(&mesh, v, random_in_box(&r, 20));
        }
        vec3 a = mesh_vertex(&mesh, 0), b = mesh_vertex(&mesh, 1), c = mesh_vertex(&mesh, 2);
        vec3 normal = vec3_unit_or(vec3_cross(vec3_sub(b, a), vec3_sub(c, a)), (vec3){1, 0, 0});
        vec3 outward = vec3_unit_or(vec3_cross(vec3_sub(b, a), normal), (vec3){1, 0, 0});
        vec3 middle = vec3_scale(1.0 / 3, vec3_add(a, vec3_add(b, c)));
        vec3 half = vec3_lerp(a, b, 0.5);
        double h = random_between(&r, -9, 9);
        struct closest out;

        closest_on_triangle(&mesh, 0, vec3_add_scaled(middle, h, normal), &out);
        assert_int_equal(out.feature, FEATURE_FACE);
        assert_vec3_near(out.point, middle, 1e-9);
        vec3 beside = vec3_add_scaled(vec3_add_scaled(half, h, normal), 3, outward);
        closest_on_triangle(&mesh, 0, beside, &out);
        assert_int_equal(out.feature, FEATURE_EDGE);
        assert_int_equal(out.corner, 0);
        assert_vec3_near(out.point, half, 1e-9);
        vec3 back =
            vec3_add(vec3_unit_or(vec3_sub(a, b), normal), vec3_unit_or(vec3_sub(a, c), normal));
        vec3 past = vec3_add_scaled(vec3_add_scaled(a, 2, back), h, normal);
        closest_on_triangle(&mesh, 0, past, &out);
        assert_int_equal(out.feature, FEATURE_VERTEX);
        assert_int_equal(out.corner, 0);
        assert_vec3_near(out.point, a, 0);
        mesh_fini(&mesh);
    }
}

static void nothing_beyond_max_distance_is_found(void **state) {
    (void)state;
    struct random r = {3};
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){40, 30, 25}, 3, 12, 7);
    struct query *query = create(&mesh);
    for (int i = 0; i < 300; i++) {
        vec3 p = random_in_box(&r, 60);
        struct closest answer = ask(query, &mesh, p, &r), other;
        uint32_t hints[] = {MESH_NONE, answer.triangle, 0};
        for (size_t k = 0; k < 3; k++) {
            double limit = answer.distance;
            assert_true(query_closest(query, p, limit, hints[k], &other));
            assert_true(same_bits(&answer, &other));
            assert_true(query_closest(query, p, limit * 2 + 1, hints[k], &other));
            assert_true(same_bits(&answer, &other));
            assert_false(query_closest(query, p, nextafter(limit, 0), hints[k], &other));
            assert_false(query_closest(query, p, limit / 2, hints[k], &other));
        }
    }
    query_destroy(&query);
    mesh_fini(&mesh);
}

// On ways of small and large steps, and where another query used the same memory between them.
static void what_the_last_search_told_changes_no_answer(void **state) {
    (void)state;
    struct random r = {15};
    struct mesh meshes[2];
    struct query *queries[2];
    struct query_near near = {0};
    shape_bumpy(&meshes[0], (vec3){40, 30, 25}, 3, 30, 7);
    shape_grid(&meshes[1], 30, 60);
    for (int i = 0; i < 2; i++)
        queries[i] = create(&meshes[i]);
    for (int way = 0; way < 400; way++) {
        const struct mesh *mesh = &meshes[way / 2 % 2];
        const struct query *query = queries[way / 2 % 2];
        uint32_t hint = MESH_NONE;
        double step = pow(10, random_between(&r, -4, 1));
        vec3 p = vec3_add(mesh_vertex(mesh, (uint32_t)way), random_in_box(&r, way % 3 ? 5 : 60));
        for (int i = 0; i < 60; i++) {
            struct closest answer, same;
            double most = i % 4 ? INFINITY : random_between(&r, 0, 20);
            bool found = query_closest(query, p, most, MESH_NONE, &answer);
            assert_int_equal(query_closest_near(query, p, most, hint, &near, &same), found);
            assert_true(!found || same_bits(&answer, &same));
            hint = found ? answer.triangle : hint;
            p = vec3_add_scaled(p, step, random_direction(&r));
        }
    }
    for (int i = 0; i < 2; i++) {
        query_destroy(&queries[i]);
        mesh_fini(&meshes[i]);
    }
}

static void a_point_on_the_surface_is_found_at_no_distance(void **state) {
    (void)state;
    struct random r = {4};
    struct mesh mesh;
    shape_sphere(&mesh, 20, 10);
    struct query *query = create(&mesh);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        struct closest c = ask(query, &mesh, mesh_vertex(&mesh, v), &r);
        assert_true(c.distance == 0);
        assert_int_equal(c.feature, FEATURE_VERTEX);
        struct closest same;
        assert_true(query_closest(query, mesh_vertex(&mesh, v), 0, MESH_NONE, &same));
        assert_true(same_bits(&c, &same));
    }
    query_destroy(&query);
    mesh_fini(&mesh);
}

// On a grid of whole numbers distances to shared edges and vertices are equal without rounding.
static void ties_go_to_the_lower_triangle(void **state) {
    (void)state;
    struct random r = {5};
    struct mesh grid;
    shape_grid(&grid, 8, 16);
    for (int turn = 0; turn < 20; turn++) {
        for (uint32_t t = grid.triangle_count - 1; t > 0; t--) { // another order of triangles
            uint32_t other = (uint32_t)(random_bits(&r) % (t + 1)), swap[3];
            memcpy(swap, grid.triangles + 3 * (size_t)t, sizeof swap);
            memmove(grid.triangles + 3 * (size_t)t, grid.triangles + 3 * (size_t)other,
                    sizeof swap);
            memcpy(grid.triangles + 3 * (size_t)other, swap, sizeof swap);
        }
        struct query *query = create(&grid);
        for (int i = 0; i < 100; i++) {
            double x = floor(random_between(&r, -7, 8)), y = floor(random_between(&r, -7, 8));
            vec3 p = {x, i % 2 ? y : y + 0.25, 3}; // above a vertex, above an edge
            struct closest c = ask(query, &grid, p, &r);
            assert_true(c.distance == 3);
            for (uint32_t t = 0; t < c.triangle; t++) {
                vec3 corner[3] = {mesh_corner(&grid, t, 0), mesh_corner(&grid, t, 1),
                                  mesh_corner(&grid, t, 2)};
                assert_true(brute_triangle(p, corner) > 3);
            }
        }
        query_destroy(&query);
    }
    mesh_fini(&grid);
}

// Both triangles of an edge, turned as they may be, give its points the same bits.
static void an_edge_is_the_same_from_both_sides(void **state) {
    (void)state;
    struct random r = {6};
    for (int i = 0; i < 500; i++) {
        struct mesh mesh;
        mesh_init(&mesh, 4, 2);
        uint32_t first = (uint32_t)i % 3, second = (uint32_t)i / 3 % 3;
        static const uint32_t corners[2][3] = {{0, 1, 2}, {1, 0, 3}};
        for (uint32_t k = 0; k < 3; k++) {
            mesh.triangles[k] = corners[0][(k + first) % 3];
            mesh.triangles[3 + k] = corners[1][(k + second) % 3];
        }
        for (uint32_t v = 0; v < 4; v++)
            mesh_set_vertex(&mesh, v, random_in_box(&r, 20));
        struct closest a, b;
        vec3 p = random_in_box(&r, 40);
        closest_on_triangle(&mesh, 0, p, &a);
        closest_on_triangle(&mesh, 1, p, &b);
        bool shared = a.feature == FEATURE_EDGE && b.feature == FEATURE_EDGE &&
                      mesh.triangles[a.corner] + mesh.triangles[(a.corner + 1) % 3] == 1 &&
                      mesh.triangles[3 + b.corner] + mesh.triangles[3 + (b.corner + 1) % 3] == 1;
        if (shared) {
            assert_true(a.distance == b.distance);
            assert_memory_equal(&a.point, &b.point, sizeof a.point);
        }
        mesh_fini(&mesh);
    }
}

static void needles_and_triangles_without_area_are_answered_rightly(void **state) {
    (void)state;
    struct random r = {7};
    for (int round = 0; round < 60; round++) {
        struct mesh soup;
        shape_soup(&soup, 20, 5 + round, (uint64_t)round);
        struct query *query = create(&soup);
        for (int i = 0; i < 60; i++)
            assert_right(query, &soup, random_in_box(&r, i % 2 ? 25 : 100), &r);
        for (uint32_t t = 0; t < soup.triangle_count; t++) { // close to each of them
            vec3 on = vec3_lerp(vec3_lerp(mesh_corner(&soup, t, 0), mesh_corner(&soup, t, 1),
                                          random_between(&r, 0, 1)),
                                mesh_corner(&soup, t, 2), random_between(&r, 0, 1));
            double off = pow(10, random_between(&r, -9, 0));
            assert_right(query, &soup, vec3_add_scaled(on, off, random_direction(&r)), &r);
        }
        query_destroy(&query);
        mesh_fini(&soup);
    }
}

static void single_needles_are_answered_rightly(void **state) {
    (void)state;
    struct random r = {8};
    for (uint64_t round = 0; round < 4000; round++) {
        struct mesh soup;
        shape_soup(&soup, 20, 5, round);
        for (int i = 0; i < 5; i++) {
            struct closest c;
            vec3 p = random_in_box(&r, i % 2 ? 25 : 1000);
            for (uint32_t t = 0; t < soup.triangle_count; t++) {
                vec3 corner[3] = {mesh_corner(&soup, t, 0), mesh_corner(&soup, t, 1),
                                  mesh_corner(&soup, t, 2)};
                closest_on_triangle(&soup, t, p, &c);
                assert_consistent(&soup, p, &c);
                assert_near(c.distance, brute_triangle(p, corner), 1e-9);
            }
        }
        mesh_fini(&soup);
    }
}

// Around the middle of a sphere all triangles are nearly as far: floats cannot tell which is the
// closest.
static void nearly_equal_distances_are_told_apart(void **state) {
    (void)state;
    struct random r = {12};
    struct mesh sphere;
    shape_sphere(&sphere, 20, 8);
    struct query *query = create(&sphere);
    for (int i = 0; i < 200; i++)
        assert_right(query, &sphere, random_in_box(&r, pow(10, random_between(&r, -14, 0))), &r);
    query_destroy(&query);
    mesh_fini(&sphere);
}

static void a_metre_away_is_as_exact(void **state) {
    (void)state;
    struct random r = {9};
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){40, 30, 25}, 3, 12, 7);
    struct query *query = create(&mesh);
    for (int i = 0; i < 200; i++)
        assert_right(query, &mesh, vec3_scale(1000, random_direction(&r)), &r);
    query_destroy(&query);
    mesh_fini(&mesh);
}

static void a_mesh_far_from_its_origin_is_as_exact(void **state) {
    (void)state;
    struct random r = {10};
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){40, 30, 25}, 3, 12, 7);
    shape_move(&mesh, (pose){quat_identity(), {5000, -3000, 8000}});
    struct query *query = create(&mesh);
    for (int i = 0; i < 200; i++)
        assert_right(query, &mesh, vec3_add(mesh_vertex(&mesh, 3), random_in_box(&r, 20)), &r);
    query_destroy(&query);
    mesh_fini(&mesh);
}

// Triangle 0 of a mesh of two: two corners close together, the third far along nearly the same
// line.
static void make_needle(struct mesh *mesh, struct random *r, uint32_t turn) {
    double length = pow(10, random_between(r, -0.3, 1.3));
    double side = length * pow(10, random_between(r, -2.6, -1.8));
    double thin = side * pow(10, random_between(r, -3, -1.7));
    vec3 along = random_direction(r), a = random_in_box(r, 5);
    vec3 b = vec3_add_scaled(vec3_add_scaled(a, side, along), thin, random_direction(r));
    vec3 corner[3] = {a, b, vec3_add_scaled(a, length, along)};
    mesh_init(mesh, 6, 2);
    for (uint32_t v = 0; v < 6; v++)
        mesh->triangles[v] = v;
    for (uint32_t v = 0; v < 3; v++)
        mesh_set_vertex(mesh, (v + turn) % 3, corner[turn % 2 ? v : 2 - v]);
}

// Triangle 1: a large one around `middle`, across `normal`.
static void make_wall(struct mesh *mesh, struct random *r, vec3 middle, vec3 normal) {
    vec3 right = vec3_unit_or(vec3_cross(normal, random_direction(r)), normal);
    vec3 up = vec3_cross(normal, right), back = vec3_add_scaled(middle, -2, right);
    mesh_set_vertex(mesh, 3, vec3_add_scaled(middle, 3, right));
    mesh_set_vertex(mesh, 4, vec3_add_scaled(back, 2, up));
    mesh_set_vertex(mesh, 5, vec3_add_scaled(back, -2, up));
}

// The wall is farther by less than floats of a needle's badly posed barycentric coordinates tell.
static void a_needle_is_found_before_what_lies_behind_it(void **state) {
    (void)state;
    struct random r = {13};
    for (uint32_t i = 0; i < 20000; i++) {
        struct mesh mesh;
        make_needle(&mesh, &r, i);
        vec3 a = mesh_corner(&mesh, 0, 0);
        vec3 ab = vec3_sub(mesh_corner(&mesh, 0, 1), a), ac = vec3_sub(mesh_corner(&mesh, 0, 2), a);
        vec3 normal = vec3_unit_or(vec3_cross(ab, ac), (vec3){1, 0, 0});
        double s = random_between(&r, 0, 1), t = random_between(&r, 0, 1 - s);
        double off = pow(10, random_between(&r, -7, -5));
        vec3 on = vec3_add_scaled(vec3_add_scaled(a, s, ab), t, ac);
        vec3 p = vec3_add_scaled(on, off, normal);
        make_wall(&mesh, &r, vec3_add_scaled(p, off + 2e-6, normal), normal);
        struct query *query = create(&mesh);
        assert_right(query, &mesh, p, &r);
        query_destroy(&query);
        mesh_fini(&mesh);
    }
}

// Where the squares of floats, and in the end those of doubles, overflow.
static void points_out_of_this_world_are_answered_all_the_same(void **state) {
    (void)state;
    struct random r = {14};
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){40, 30, 25}, 3, 12, 7);
    struct query *query = create(&mesh);
    for (int exponent = 4; exponent <= 307; exponent++) {
        vec3 p = vec3_scale(pow(10, exponent), random_direction(&r));
        struct closest answer = ask(query, &mesh, p, &r), best = closest_of_all(&mesh, p), none;
        assert_true(vec3_is_finite(answer.point));
        assert_true(same_bits(&answer, &best) || (answer.distance == INFINITY));
        assert_false(query_closest(query, p, 12, answer.triangle, &none));
    }
    query_destroy(&query);
    mesh_fini(&mesh);
}

// ---- threads ----

#define QUESTIONS 4000

struct asker {
    const struct query *query;
    uint64_t seed;
    struct closest answers[QUESTIONS];
};

static void *ask_all(void *user) {
    struct asker *asker = user;
    struct random places = {11}, hints = {asker->seed};
    for (int i = 0; i < QUESTIONS; i++) {
        vec3 p = random_in_box(&places, 60);
        query_closest(asker->query, p, INFINITY, (uint32_t)random_bits(&hints) % 2000,
                      &asker->answers[i]);
    }
    return NULL;
}

static void threads_get_the_same_bits(void **state) {
    (void)state;
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){40, 30, 25}, 3, 15, 7);
    struct query *query = create(&mesh);
    struct asker *askers = alloc(2, sizeof *askers);
    pthread_t threads[2];
    for (uint64_t i = 0; i < 2; i++) {
        askers[i].query = query;
        askers[i].seed = i;
        assert_int_equal(pthread_create(&threads[i], NULL, ask_all, &askers[i]), 0);
    }
    for (int i = 0; i < 2; i++)
        pthread_join(threads[i], NULL);
    for (int i = 0; i < QUESTIONS; i++)
        assert_true(same_bits(&askers[0].answers[i], &askers[1].answers[i]));
    free(askers);
    query_destroy(&query);
    mesh_fini(&mesh);
}

// ---- levels of CPUs ----

// near: NULL for none.
static struct closest search_by(void (*search)(struct nearest_search *search),
                                const struct mesh *mesh, const struct cluster_tree *tree, vec3 p,
                                struct query_near *near) {
    struct nearest_search s = {.mesh = mesh,
                               .tree = tree,
                               .p = p,
                               .p_single = {(float)p.x, (float)p.y, (float)p.z},
                               .margin = 1e-3,
                               .near = near};
    nearest_limit(&s, INFINITY);
    search(&s);
    assert_true(s.found);
    return s.best;
}

static void every_cpu_level_finds_the_same(void **state) {
    (void)state;
    struct random r = {14};
    for (int shape = 0; shape < 3; shape++) {
        struct mesh mesh;
        struct cluster_tree tree;
        if (shape == 2)
            shape_box(&mesh, (vec3){10, 20, 30});
        else
            shape_bumpy(&mesh, (vec3){40, 30, 25}, 3, shape ? 30 : 5, 7);
        cluster_tree_init(&tree, &mesh);
        for (int i = 0; i < 200; i++) {
            vec3 p = random_in_box(&r, 50);
            struct closest best = closest_of_all(&mesh, p);
            struct query_near near = {.from = p, .clear = INFINITY};
            struct closest plain = search_by(nearest_search_plain, &mesh, &tree, p, NULL);
            assert_true(same_bits(&plain, &best));
            plain = search_by(nearest_search_plain, &mesh, &tree, p, &near);
            assert_true(same_bits(&plain, &best));
            plain = search_by(nearest_look_plain, &mesh, &tree, p, &near);
            assert_true(same_bits(&plain, &best));
#ifdef __x86_64__
            if (!__builtin_cpu_supports("avx2"))
                continue;
            struct query_near same = {.from = p, .clear = INFINITY};
            struct closest wide = search_by(nearest_search_avx2, &mesh, &tree, p, NULL);
            assert_true(same_bits(&wide, &best));
            wide = search_by(nearest_search_avx2, &mesh, &tree, p, &same);
            assert_true(same_bits(&wide, &best));
            wide = search_by(nearest_look_avx2, &mesh, &tree, p, &same);
            assert_true(same_bits(&wide, &best));
            assert_memory_equal(&same, &near, sizeof near);
#endif
        }
        cluster_tree_fini(&tree);
        mesh_fini(&mesh);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(answers_agree_with_every_triangle_tried),
        cmocka_unit_test(faces_edges_and_vertices_are_told_apart),
        cmocka_unit_test(nothing_beyond_max_distance_is_found),
        cmocka_unit_test(what_the_last_search_told_changes_no_answer),
        cmocka_unit_test(a_point_on_the_surface_is_found_at_no_distance),
        cmocka_unit_test(ties_go_to_the_lower_triangle),
        cmocka_unit_test(an_edge_is_the_same_from_both_sides),
        cmocka_unit_test(needles_and_triangles_without_area_are_answered_rightly),
        cmocka_unit_test(single_needles_are_answered_rightly),
        cmocka_unit_test(nearly_equal_distances_are_told_apart),
        cmocka_unit_test(a_metre_away_is_as_exact),
        cmocka_unit_test(a_mesh_far_from_its_origin_is_as_exact),
        cmocka_unit_test(a_needle_is_found_before_what_lies_behind_it),
        cmocka_unit_test(points_out_of_this_world_are_answered_all_the_same),
        cmocka_unit_test(threads_get_the_same_bits),
        cmocka_unit_test(every_cpu_level_finds_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
