#include "match/soup.h"

#include "random.h"
#include "test.h"

// ---- by looking at all of them ------------------------------------------------------------------

static struct soup_closest by_brute_force(const struct soup *soup,
                                          const struct soup_search *search) {
    struct soup_closest best = {.index = MESH_NONE, .distance = search->within}, found;
    for (uint32_t t = 0; t < soup->count; t++) {
        vec3 normal = soup->at[t].normal;
        if (vec3_dot(search->facing, normal) < search->least || !vec3_dot(normal, normal))
            continue;
        soup_closest_on(soup, t, search->point, &found);
        if (found.distance < best.distance)
            best = found;
    }
    return best;
}

static void random_triangle(struct random *r, vec3 out[3]) {
    vec3 at = random_in_box(r, 4);
    double size = random_bits(r) % 8 ? 0.5 : 4;
    for (int i = 0; i < 3; i++)
        out[i] = vec3_add(at, random_in_box(r, size));
    if (random_bits(r) % 16 == 0)
        out[2] = out[1]; // no area
}

static void assert_all_found(struct soup *soup, struct random *r, int searches) {
    static const double least[] = {-2, -0.3, 0.3, 0.9}, within[] = {0.15, 0.25, 8, INFINITY};
    for (int i = 0; i < searches; i++) {
        struct soup_search search = {
            .point = random_in_box(r, 6),
            .facing = random_direction(r),
            .least = least[random_bits(r) % 4],
            .within = within[random_bits(r) % 4],
            .hint = random_bits(r) % 2 ? MESH_NONE : (uint32_t)(random_bits(r) % soup->count)};
        struct soup_closest found, expected = by_brute_force(soup, &search);
        assert_int_equal(soup_closest(soup, &search, &found), expected.index != MESH_NONE);
        assert_int_equal(found.index, expected.index);
        assert_true(found.distance == expected.distance);
    }
}

static struct soup random_soup(struct random *r, int count) {
    struct soup soup = {0};
    for (int i = 0; i < count; i++) {
        vec3 corners[3];
        random_triangle(r, corners);
        soup_add(&soup, corners, (uint32_t)i, i % 3 == 0);
    }
    soup_build(&soup);
    return soup;
}

// ---- what it promises ---------------------------------------------------------------------------

static void the_closest_one_is_found(void **state) {
    (void)state;
    struct random r = {3};
    for (int round = 0; round < 20; round++) {
        struct soup soup = random_soup(&r, 1 << (round % 10));
        assert_all_found(&soup, &r, 300);
        soup_fini(&soup);
    }
}

static void a_triangle_is_found_where_it_has_moved_to(void **state) {
    (void)state;
    struct random r = {4};
    struct soup soup = random_soup(&r, 400);
    int left = 0;
    for (int round = 0; round < 60; round++) {
        bool stayed = true;
        for (uint32_t t = 0; t < soup.count; t += 3) {
            double way = random_bits(&r) % 400 ? 0.02 : 1;
            vec3 corners[3], by = random_in_box(&r, way);
            for (int i = 0; i < 3; i++)
                corners[i] = vec3_add(soup.at[t].corners[i], vec3_add(by, random_in_box(&r, 0.02)));
            stayed &= soup_move(&soup, t, corners);
        }
        left += !stayed;
        if (!stayed)
            soup_build(&soup);
        assert_all_found(&soup, &r, 50);
    }
    assert_true(left > 0 && left < 60);
    soup_fini(&soup);
}

static void none_faces_where_none_may(void **state) {
    (void)state;
    struct random r = {5};
    struct soup soup = random_soup(&r, 60);
    int none = 0;
    for (int i = 0; i < 3000; i++) {
        vec3 p = random_in_box(&r, 5), by = {0.3, 0.3, 0.3};
        struct soup_search search = {p, random_direction(&r), 0.3, 0.3, MESH_NONE};
        struct box box = {vec3_sub(p, by), vec3_add(p, by)};
        if (soup_may_face(&soup, box, search.facing, search.least))
            continue;
        assert_int_equal(by_brute_force(&soup, &search).index, MESH_NONE);
        none++;
    }
    assert_true(none > 300);
    soup_fini(&soup);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_closest_one_is_found),
        cmocka_unit_test(a_triangle_is_found_where_it_has_moved_to),
        cmocka_unit_test(none_faces_where_none_may),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
