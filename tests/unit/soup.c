#define WIDE 4
#define WIDE_TARGET
#include "match/soup_walk.h"
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

static struct soup_closest by_level(const struct soup *soup, const struct soup_search *search,
                                    void (*walk_level)(struct looking *)) {
    struct soup_closest best;
    struct looking looking = soup_begin(soup, search, &best);
    walk_level(&looking);
    return best;
}

static void assert_same_at_every_cpu_level(const struct soup *soup,
                                           const struct soup_search *search) {
    struct soup_closest plain = by_level(soup, search, soup_walk_plain);
    struct soup_closest expected = by_brute_force(soup, search);
    assert_int_equal(plain.index, expected.index);
    assert_true(plain.distance == expected.distance);
#ifdef __x86_64__
    if (!__builtin_cpu_supports("avx2"))
        return;
    struct soup_closest wide = by_level(soup, search, soup_walk_avx2);
    assert_int_equal(wide.index, expected.index);
    assert_true(wide.distance == expected.distance);
#endif
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
        assert_same_at_every_cpu_level(soup, &search);
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
    for (int round = 0; round < 60; round++) {
        for (uint32_t t = 0; t < soup.count; t += 3) {
            double way = random_bits(&r) % 400 ? 0.02 : 1;
            vec3 corners[3], by = random_in_box(&r, way);
            for (int i = 0; i < 3; i++)
                corners[i] = vec3_add(soup.at[t].corners[i], vec3_add(by, random_in_box(&r, 0.02)));
            soup_move(&soup, t, corners);
        }
        soup_settle(&soup);
        assert_all_found(&soup, &r, 50);
    }
    soup_fini(&soup);
}

// Each triangle is there twice.
static void of_equals_the_first_one_counts(void **state) {
    (void)state;
    struct random r = {6};
    struct soup soup = random_soup(&r, 100);
    uint32_t all[200];
    for (uint32_t i = 0; i < 100; i++) {
        struct soup_triangle twin = soup.at[i];
        soup_add(&soup, twin.corners, i, false);
    }
    for (uint32_t i = 0; i < 200; i++)
        all[i] = 199 - i;
    soup_build(&soup);
    for (int i = 0; i < 1000; i++) {
        struct soup_search search = {random_in_box(&r, 6), random_direction(&r), 0.3, 2,
                                     100 + (uint32_t)(random_bits(&r) % 100)};
        struct soup_closest found, among, expected = by_brute_force(&soup, &search);
        soup_closest(&soup, &search, &found);
        soup_closest_among(&soup, &search, all, 200, &among);
        assert_true(expected.index < 100 || expected.index == MESH_NONE);
        assert_int_equal(found.index, expected.index);
        assert_int_equal(among.index, expected.index);
    }
    soup_fini(&soup);
}

struct visited {
    int times[400];
};

static void visit(void *context, uint32_t index) {
    ((struct visited *)context)->times[index]++;
}

static bool meets(const vec3 c[3], struct box box) {
    const double *low = &box.min.x, *high = &box.max.x;
    bool is_met = true;
    for (int i = 0; i < 3; i++) {
        double x = (&c[0].x)[i], y = (&c[1].x)[i], z = (&c[2].x)[i];
        is_met &= fmin(x, fmin(y, z)) <= high[i] && fmax(x, fmax(y, z)) >= low[i];
    }
    return is_met;
}

static void all_near_a_box_are_visited_once(void **state) {
    (void)state;
    struct random r = {5};
    struct soup soup = random_soup(&r, 400);
    int met = 0, facing_met = 0, passed = 0;
    for (int i = 0; i < 3000; i++) {
        vec3 p = random_in_box(&r, 5), by = {0.3, 0.3, 0.3}, facing = random_direction(&r);
        struct box box = {vec3_sub(p, by), vec3_add(p, by)};
        struct visited near = {{0}}, looking = {{0}};
        soup_near(&soup, box, visit, &near);
        soup_near_facing(&soup, box, facing, 0.3, visit, &looking);
        for (uint32_t t = 0; t < soup.count; t++) {
            vec3 normal = soup.at[t].normal;
            bool is_met = meets(soup.at[t].corners, box);
            bool is_facing = vec3_dot(normal, normal) > 0 && vec3_dot(normal, facing) >= 0.3;
            assert_true(near.times[t] <= 1 && near.times[t] >= is_met);
            assert_int_equal(looking.times[t], near.times[t] && is_facing);
            met += is_met;
            facing_met += is_met && is_facing;
            passed += !near.times[t];
        }
    }
    assert_true(met > 1000 && facing_met > 300 && passed > 1000000);
    soup_fini(&soup);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_closest_one_is_found),
        cmocka_unit_test(a_triangle_is_found_where_it_has_moved_to),
        cmocka_unit_test(of_equals_the_first_one_counts),
        cmocka_unit_test(all_near_a_box_are_visited_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
