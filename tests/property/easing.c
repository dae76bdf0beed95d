// How a cut's new blends reach the displacements that the warp reads, and their means.
#include "step/easing.h"

#include "base/check.h"
#include "generated.h"
#include "random.h"
#include "step/scene.h"
#include "step/settings.h"
#include "test.h"

#include <stdlib.h>

static struct scene *scene;
static const struct case_group *meniscus;

static int make_scene(void **state) {
    (void)state;
    struct error err;
    struct knee_case *knee = generated_knee(CASES "/healthy");
    if (scene_create(&knee, &scene, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    meniscus = &scene->knee->groups[scene->tissues[0].group];
    return 0;
}

static int drop_scene(void **state) {
    (void)state;
    scene_destroy(&scene);
    return 0;
}

static int rules_of(const void *state) {
    return *(const int *)state;
}

static struct easing *start(enum field_kind kind, int rules) {
    struct field field = field_default(kind);
    return easing_create(scene, 0, &field, rules);
}

// A blend up to `most`, or an offset that far.
static void aim_at(struct random *r, double most, int width, double *out) {
    vec3 way = {-0.6, 0.8, -0.1};
    double share = random_between(r, 0.9 * most, most);
    for (int k = 0; k < width; k++)
        out[k] = width == 1 ? share : share * 3 * (&way.x)[k];
}

// Every stride-th vertex to a place of its own.
static void aim(struct easing *easing, uint32_t stride, int rules, struct random *r) {
    uint32_t count = meniscus->mesh.vertex_count / stride;
    struct touch_change touch = {.width = rules >= RULES_TOUCH_FITTED ? 3 : 1, .count = count};
    touch.vertices = alloc(count, sizeof *touch.vertices);
    touch.values = alloc((size_t)touch.width * count, sizeof *touch.values);
    double most = random_between(r, 0, 1);
    for (uint32_t i = 0; i < count; i++) {
        touch.vertices[i] = i * stride;
        aim_at(r, most, touch.width, touch.values + (size_t)touch.width * i);
    }
    easing_aim(easing, &touch);
    free(touch.vertices);
    free(touch.values);
}

static vec3 somewhere(struct random *r) {
    uint32_t vertex = (uint32_t)(random_bits(r) % meniscus->mesh.vertex_count);
    return vec3_add(mesh_vertex(&meniscus->mesh, vertex), random_in_box(r, 2));
}

static double distance_to(vec3 p) {
    struct closest c;
    assert_true(query_closest(scene->queries[scene->tissues[0].group], p, 100, MESH_NONE, &c));
    return fmax(c.distance, 0.01);
}

static vec3 mean_at(const struct surface_mean *mean, vec3 p) {
    struct surface_value value;
    assert_true(surface_mean_at(mean, p, distance_to(p), &value));
    return value.displacement;
}

static void assert_is_kept_up(const struct easing *easing, struct random *r) {
    struct surface_mean *fresh =
        surface_mean_create(scene->trees[scene->tissues[0].group], easing_displacement(easing));
    for (int i = 0; i < 30; i++) {
        vec3 p = somewhere(r);
        assert_vec3_near(mean_at(easing_mean(easing), p), mean_at(fresh, p), 0);
    }
    surface_mean_destroy(&fresh);
}

static void the_mean_is_kept_up_with_easing_and_restoring(void **state) {
    int rules = rules_of(*state);
    struct random r = {1};
    struct easing *easing = start(FIELD_SMOOTH, rules);
    assert_is_kept_up(easing, &r);
    for (int cut = 0; cut < 5; cut++) {
        aim(easing, 1 + 5 * (uint32_t)cut, rules, &r);
        for (int i = 0; i < 3; i++) {
            easing_advance(easing, i < 2 ? 0.3 : 1);
            assert_is_kept_up(easing, &r);
        }
        assert_false(easing_active(easing));
        aim(easing, 1 + 5 * (uint32_t)cut, rules, &r);
        easing_advance(easing, 0.5);
        if (cut % 2) {
            easing_restore(easing);
            assert_false(easing_active(easing));
            assert_is_kept_up(easing, &r);
        }
    }
    easing_destroy(&easing);
}

static void a_smooth_tip_feels_no_more_than_the_rest_that_it_is_told(void **state) {
    int rules = rules_of(*state);
    struct random r = {2};
    struct easing *easing = start(FIELD_SMOOTH, rules);
    double most = 0;
    for (int cut = 0; cut < 10; cut++) {
        vec3 at[20], before[20];
        aim(easing, 1, rules, &r);
        for (int i = 0; i < 20; i++) {
            at[i] = somewhere(&r);
            before[i] = mean_at(easing_mean(easing), at[i]);
        }
        double rest = easing_rest_mm(easing, at[0], 0), share = random_between(&r, 0.1, 1);
        assert_near(easing_rest_mm(easing, at[0], MESH_NONE), 0, 0);
        easing_advance(easing, share);
        for (int i = 0; i < 20; i++) {
            double change = vec3_distance(mean_at(easing_mean(easing), at[i]), before[i]);
            assert_true(change <= share * rest * (1 + 1e-5));
            most = fmax(most, change / (share * rest));
        }
    }
    assert_true(most > 0.5); // and is told little more
    easing_destroy(&easing);
}

static vec3 integral_at(const struct surface_integral *integral, vec3 p) {
    struct closest c;
    struct surface_sight sight;
    assert_true(query_closest(scene->queries[scene->tissues[0].group], p, 100, MESH_NONE, &c));
    assert_true(surface_integral_at(integral, p, c.point, &sight));
    return sight.displacement;
}

static void assert_integral_is_kept_up(const struct easing *easing, struct random *r) {
    struct surface_integral *fresh = surface_integral_create(scene->blocks[scene->tissues[0].group],
                                                             easing_displacement(easing));
    for (int i = 0; i < 30; i++) {
        vec3 p = somewhere(r);
        assert_vec3_near(integral_at(easing_integral(easing), p), integral_at(fresh, p), 0);
    }
    surface_integral_destroy(&fresh);
}

// What is left of the change at each place, to its last digits, also while new cuts land amid it.
static void with_an_integral_a_tip_is_told_exactly_what_it_will_feel(void **state) {
    struct random r = {3};
    int rules = rules_of(*state);
    struct easing *easing = start(FIELD_INTEGRAL, rules);
    assert_integral_is_kept_up(easing, &r);
    for (int cut = 0; cut < 12; cut++) {
        vec3 at[20], before[20];
        double rest[20];
        aim(easing, 1 + (uint32_t)cut % 3, rules, &r);
        for (int i = 0; i < 20; i++) {
            at[i] = somewhere(&r);
            before[i] = integral_at(easing_integral(easing), at[i]);
            rest[i] = easing_rest_mm(easing, at[i], 0);
        }
        double share = cut % 4 == 3 ? 1 : random_between(&r, 0.1, 1);
        easing_advance(easing, share);
        assert_integral_is_kept_up(easing, &r);
        for (int i = 0; i < 20; i++) {
            double change = vec3_distance(integral_at(easing_integral(easing), at[i]), before[i]);
            assert_near(change, share * rest[i], 1e-6);
            assert_near(easing_rest_mm(easing, at[i], 0), (1 - share) * rest[i], 1e-6);
        }
        if (cut % 5 != 4)
            continue;
        easing_restore(easing);
        assert_integral_is_kept_up(easing, &r);
        assert_near(easing_rest_mm(easing, at[0], 0), 0, 0);
    }
    easing_destroy(&easing);
}

static void each_field_keeps_up_what_it_reads(void **state) {
    (void)state;
    for (int kind = 0; kind < FIELD_COUNT; kind++) {
        struct easing *easing = start((enum field_kind)kind, RULES_NEWEST);
        assert_int_equal(easing_mean(easing) != NULL, kind == FIELD_SMOOTH);
        assert_int_equal(easing_integral(easing) != NULL, kind == FIELD_INTEGRAL);
        easing_destroy(&easing);
    }
}

// The last test: the meniscus stays so.
static void a_group_that_bridges_two_bones_has_neither(void **state) {
    (void)state;
    case_group_bridge(&scene->knee->groups[scene->tissues[0].group], BODY_FEMUR);
    struct easing *easing = start(FIELD_SMOOTH, RULES_NEWEST);
    assert_null(easing_mean(easing));
    easing_destroy(&easing);
    easing = start(FIELD_INTEGRAL, RULES_NEWEST);
    assert_null(easing_integral(easing));
    easing_destroy(&easing);
}

int main(void) {
    static int blends = RULES_TOUCH_FITTED - 1, offsets = RULES_TOUCH_FITTED;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_prestate(the_mean_is_kept_up_with_easing_and_restoring, &blends),
        cmocka_unit_test_prestate(the_mean_is_kept_up_with_easing_and_restoring, &offsets),
        cmocka_unit_test_prestate(a_smooth_tip_feels_no_more_than_the_rest_that_it_is_told,
                                  &blends),
        cmocka_unit_test_prestate(a_smooth_tip_feels_no_more_than_the_rest_that_it_is_told,
                                  &offsets),
        cmocka_unit_test_prestate(with_an_integral_a_tip_is_told_exactly_what_it_will_feel,
                                  &blends),
        cmocka_unit_test_prestate(with_an_integral_a_tip_is_told_exactly_what_it_will_feel,
                                  &offsets),
        cmocka_unit_test(each_field_keeps_up_what_it_reads),
        cmocka_unit_test(a_group_that_bridges_two_bones_has_neither),
    };
    return cmocka_run_group_tests_name("easing", tests, make_scene, drop_scene);
}
