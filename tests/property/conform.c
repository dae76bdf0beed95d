// S'' put onto a cut mesh: equal volume, no crossings, the same bits, always an end.
#include "conform_body.h"
#include "match/conform_gradients.h"
#include "match/conform_parts.h"
#include "match/mismatch.h"
#include "scene/shapes.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

// ---- bites --------------------------------------------------------------------------------------

static void check_bites(struct body *b, uint64_t seed, int bites) {
    struct random r = {seed};
    double whole = match_surface_volume(b->surface);
    for (int i = 0; i < bites; i++) {
        struct cut_state state;
        if (!body_bite(b, &r, &state))
            continue;
        struct conform_report report = follow(b->conform, &state, false);
        assert_near(body_volume(b), state.volume, 1e-9 * whole);
        assert_near(report.left_mm3, 0, 1e-9 * whole);
        assert_near(report.volume_mm3, body_volume(b), 1e-9 * whole);
        assert_int_equal(body_crossings(b), 0);
        assert_true(report.repairs <= 12);
        cut_state_fini(&state);
    }
}

static void bites_are_followed_at_equal_volume_without_crossings(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        struct body sphere, meniscus;
        body_sphere(&sphere, 10);
        check_bites(&sphere, seed, 6);
        body_fini(&sphere);
        body_meniscus(&meniscus);
        check_bites(&meniscus, seed + 10, 6);
        body_fini(&meniscus);
    }
}

static void one_bite_is_met_where_it_is(void **state) {
    (void)state;
    double before_all = 0, after_all = 0;
    for (uint64_t seed = 1; seed <= 6; seed++) {
        struct random r = {seed};
        struct cut_state cut;
        struct body b;
        body_sphere(&b, 40);
        while (!body_bite(&b, &r, &cut))
            ;
        follow(b.conform, &cut, false);
        double before = body_apart_mm3(&b, &cut, false), after = body_apart_mm3(&b, &cut, true);
        assert_true(before > 1 && after < before / 2);
        before_all += before;
        after_all += after;
        cut_state_fini(&cut);
        body_fini(&b);
    }
    assert_true(after_all < before_all / 3);
}

// Two ways to the same: by the rules before, and in fewer and rougher steps.
static void fewer_steps_meet_bites_as_well(void **state) {
    (void)state;
    double apart[2] = {0};
    for (uint64_t seed = 1; seed <= 3; seed++) {
        struct random r = {seed};
        struct body b;
        struct cut_state cut;
        body_sphere(&b, 30);
        struct conform *thorough = conform_create(b.surface);
        for (int i = 0; i < 4; i++) {
            while (!body_bite(&b, &r, &cut))
                ;
            follow(b.conform, &cut, false);
            follow_thoroughly(thorough, &cut);
            if (i < 3)
                cut_state_fini(&cut);
        }
        assert_false(same_bits(b.conform, thorough, b.whole.vertex_count));
        apart[0] += body_apart_mm3(&b, &cut, true);
        conform_destroy(&b.conform);
        b.conform = thorough;
        apart[1] += body_apart_mm3(&b, &cut, true);
        assert_near(body_volume(&b), cut.volume, 1e-9 * match_surface_volume(b.surface));
        assert_int_equal(body_crossings(&b), 0);
        cut_state_fini(&cut);
        body_fini(&b);
    }
    assert_true(apart[0] < 1.1 * apart[1]);
}

// Of the last system of a fit; with contacts through thin tissue.
static void every_level_of_processors_solves_to_the_same_bits(void **state) {
    (void)state;
#if defined(__x86_64__)
    if (!__builtin_cpu_supports("avx2"))
        skip();
    uint32_t contacts = 0;
    for (uint64_t seed = 40; seed < 43; seed++) {
        struct random r = {seed};
        struct cut_state cut;
        struct body b;
        body_lens(&b, 12);
        while (!body_bite(&b, &r, &cut))
            ;
        follow(b.conform, &cut, false);
        struct conform *c = b.conform;
        vec3 *plain = calloc(c->active_count, sizeof *plain);
        vec3 *wide = calloc(c->active_count, sizeof *wide);
        conform_gradients_plain(c, c->gradient, 1e-8, plain);
        conform_gradients_avx2(c, c->gradient, 1e-8, wide);
        assert_true(c->active_count > 10);
        assert_memory_equal(plain, wide, c->active_count * sizeof *plain);
        contacts += c->contact_count;
        free(plain);
        free(wide);
        cut_state_fini(&cut);
        body_fini(&b);
    }
    assert_true(contacts > 0);
#endif
}

static void the_same_calls_give_the_same_bits(void **state) {
    (void)state;
    struct random r = {5};
    struct body b;
    body_sphere(&b, 10);
    struct conform *other = conform_create(b.surface);
    for (int i = 0; i < 4; i++) {
        struct cut_state cut;
        if (!body_bite(&b, &r, &cut))
            continue;
        struct conform *copy = conform_copy(b.conform);
        struct conform_report one = follow(b.conform, &cut, false),
                              two = follow(other, &cut, false);
        follow(copy, &cut, false);
        assert_memory_equal(&one.volume_mm3, &two.volume_mm3, sizeof one.volume_mm3);
        assert_true(same_bits(b.conform, other, b.whole.vertex_count));
        assert_true(same_bits(b.conform, copy, b.whole.vertex_count));
        conform_destroy(&copy);
        cut_state_fini(&cut);
    }
    conform_destroy(&other);
    body_fini(&b);
}

// Back by some cuts, and on again: the way as it was, to the bit.
static void what_it_followed_can_be_taken_back(void **state) {
    (void)state;
    enum { CUTS = 6, BACK = 4 };
    struct random r = {23};
    struct body b;
    struct cut_state cuts[CUTS];
    struct conform_past past[CUTS];
    struct conform *after[CUTS + 1];
    body_sphere(&b, 14);
    after[0] = conform_copy(b.conform);
    for (int i = 0; i < CUTS; i++) {
        while (!body_bite(&b, &r, &cuts[i]))
            ;
        follow(b.conform, &cuts[i], false);
        conform_past(b.conform, &past[i]);
        after[i + 1] = conform_copy(b.conform);
        assert_false(same_bits(after[i], after[i + 1], b.whole.vertex_count));
    }
    for (int i = CUTS; i-- > CUTS - BACK;) {
        conform_take_back(b.conform, &past[i]);
        assert_true(same_bits(b.conform, after[i], b.whole.vertex_count));
        assert_memory_equal(b.conform->dirty, after[i]->dirty, b.whole.vertex_count);
    }
    for (int i = CUTS - BACK; i < CUTS; i++) {
        follow(b.conform, &cuts[i], false);
        assert_true(same_bits(b.conform, after[i + 1], b.whole.vertex_count));
    }
    for (int i = 0; i < CUTS; i++) {
        cut_state_fini(&cuts[i]);
        conform_past_fini(&past[i]);
    }
    for (int i = 0; i <= CUTS; i++)
        conform_destroy(&after[i]);
    body_fini(&b);
}

static void what_is_far_from_a_cut_stays(void **state) {
    (void)state;
    struct random r = {6};
    struct cut_state cut;
    struct body b;
    body_meniscus(&b);
    while (!body_bite(&b, &r, &cut))
        ;
    struct conform_report report = follow(b.conform, &cut, false);
    assert_true(report.changed_count > 0);
    uint32_t next = 0;
    for (uint32_t v = 0; v < b.whole.vertex_count; v++) {
        bool listed = next < report.changed_count && report.changed[next] == v;
        vec3 p = conform_vertex(b.conform, v), q = mesh_vertex(&b.whole, v);
        next += listed;
        assert_int_equal(vec3_distance(p, q) > 0, listed);
    }
    assert_int_equal(next, report.changed_count);
    assert_true(report.changed_count < b.whole.vertex_count / 2);
    cut_state_fini(&cut);
    body_fini(&b);
}

// ---- targets that nobody can follow -------------------------------------------------------------

// S' crumpled: its own triangles in another shape, all of them fresh.
static void crumple(const struct body *b, struct random *r, double by_mm, struct cut_state *out) {
    mesh_copy(&out->mesh, &b->whole);
    for (uint32_t v = 0; v < out->mesh.vertex_count; v++)
        mesh_set_vertex(&out->mesh, v,
                        vec3_add(mesh_vertex(&b->whole, v), random_in_box(r, by_mm)));
    out->fresh = calloc(out->mesh.triangle_count, sizeof *out->fresh);
    for (uint32_t t = 0; t < out->mesh.triangle_count; t++)
        out->fresh[t] = random_bits(r) % 3 == 0;
    out->volume = match_surface_volume(b->surface) * random_between(r, 0.3, 1.5);
}

static void no_target_makes_it_cross(void **state) {
    (void)state;
    struct random r = {7};
    struct body b;
    body_sphere(&b, 8);
    for (int i = 0; i < 4; i++) {
        struct cut_state wild;
        crumple(&b, &r, 1.5, &wild);
        struct conform_report report = follow(b.conform, &wild, false);
        assert_int_equal(body_crossings(&b), 0);
        assert_near(report.left_mm3, body_volume(&b) - wild.volume, 1e-9);
        assert_true(report.repairs <= 12);
        cut_state_fini(&wild);
    }
    body_fini(&b);
}

// The fit crosses itself and cannot all be had, and the volume is had all the same.
static void equal_volume_where_the_fit_crosses_itself(void **state) {
    (void)state;
    uint32_t crossings = 0;
    for (uint64_t seed = 32; seed < 35; seed++) {
        struct random r = {seed};
        struct body b;
        body_lens(&b, 12);
        for (int i = 0; i < 3; i++) {
            struct cut_state wild;
            crumple(&b, &r, 1.2, &wild);
            wild.volume = body_volume(&b) * random_between(&r, 0.95, 0.99);
            crossings += follow(b.conform, &wild, false).crossings_first;
            assert_near(body_volume(&b), wild.volume, 1e-9 * match_surface_volume(b.surface));
            assert_int_equal(body_crossings(&b), 0);
            cut_state_fini(&wild);
        }
        body_fini(&b);
    }
    assert_true(crossings > 100);
}

// Where smoothing has not helped: repairs rarely fail, so the way back is taken by hand.
static void the_way_back_leaves_no_crossing(void **state) {
    (void)state;
    for (uint64_t seed = 20; seed < 26; seed++) {
        struct random r = {seed};
        struct cut_state cut;
        struct body b;
        body_sphere(&b, 12);
        while (!body_bite(&b, &r, &cut))
            ;
        follow(b.conform, &cut, false);
        for (uint32_t i = 0; i < b.conform->active_count; i++) {
            vec3 *p = &b.conform->positions[b.conform->active[i]];
            *p = vec3_add(*p, random_in_box(&r, 2));
        }
        assert_true(body_crossings(&b) > 0);
        assert_true(conform_go_back(b.conform, 5) > 0);
        assert_int_equal(body_crossings(&b), 0);
        cut_state_fini(&cut);
        body_fini(&b);
    }
}

static void without_fresh_triangles_nothing_moves(void **state) {
    (void)state;
    struct body b;
    body_sphere(&b, 8);
    double volume = match_surface_volume(b.surface);
    bool *fresh = calloc(b.whole.triangle_count, sizeof *fresh);
    struct conform_target target = {&b.whole, fresh, volume - 3, true, true};
    struct conform_report report;
    conform_to(b.conform, &target, &report);
    assert_near(report.left_mm3, 3, 1e-9);
    assert_int_equal(report.changed_count, 0);
    free(fresh);
    body_fini(&b);
}

// Two balls beside one another have a lens in common. A cleft that takes a half of them leaves
// half.
static void touch_and_sight_differ_by_what_is_not_in_both(void **state) {
    (void)state;
    double r = 6, apart = 1.3, half = 20;
    struct mesh a, b;
    struct convex cleft;
    struct error err;
    struct mismatch m, split;
    shape_sphere(&a, r, 60);
    mesh_copy(&b, &a);
    for (uint32_t v = 0; v < b.vertex_count; v++)
        mesh_set_vertex(&b, v, vec3_add(mesh_vertex(&b, v), (vec3){0, apart, 0}));
    struct mismatch_setting setting = {.touched = &a, .tissue = &b, .step_mm = 0.1};
    mismatch_measure(&setting, &m);
    double lens = M_PI * (4 * r + apart) * (2 * r - apart) * (2 * r - apart) / 12;
    double alone = 4.0 / 3 * M_PI * r * r * r - lens;
    assert_near(m.touched_mm3, alone, 0.01 * alone);
    assert_near(m.seen_mm3, alone, 0.01 * alone);
    struct plane planes[6] = {{{1, 0, 0}, 0},     {{-1, 0, 0}, half}, {{0, 1, 0}, half},
                              {{0, -1, 0}, half}, {{0, 0, 1}, half},  {{0, 0, -1}, half}};
    assert_ok(convex_create(planes, 6, &cleft, &err));
    setting.clefts = &cleft;
    setting.cleft_count = 1;
    mismatch_measure(&setting, &split);
    assert_near(split.touched_mm3, m.touched_mm3 / 2, 0.01 * alone);
    assert_near(split.seen_mm3, m.seen_mm3 / 2, 0.01 * alone);
    for (size_t i = 0; i < 3 * (size_t)b.vertex_count; i++)
        b.positions[i] = 0.5F * a.positions[i];
    mismatch_measure(&(struct mismatch_setting){.touched = &a, .tissue = &b, .step_mm = 0.1}, &m);
    assert_near(m.touched_mm3, 4.0 / 3 * M_PI * r * r * r * 7 / 8, 5);
    assert_near(m.seen_mm3, 0, 0);
    mesh_fini(&a);
    mesh_fini(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bites_are_followed_at_equal_volume_without_crossings),
        cmocka_unit_test(one_bite_is_met_where_it_is),
        cmocka_unit_test(fewer_steps_meet_bites_as_well),
        cmocka_unit_test(every_level_of_processors_solves_to_the_same_bits),
        cmocka_unit_test(the_same_calls_give_the_same_bits),
        cmocka_unit_test(what_it_followed_can_be_taken_back),
        cmocka_unit_test(what_is_far_from_a_cut_stays),
        cmocka_unit_test(no_target_makes_it_cross),
        cmocka_unit_test(equal_volume_where_the_fit_crosses_itself),
        cmocka_unit_test(the_way_back_leaves_no_crossing),
        cmocka_unit_test(without_fresh_triangles_nothing_moves),
        cmocka_unit_test(touch_and_sight_differ_by_what_is_not_in_both),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
