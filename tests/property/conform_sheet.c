// S'' where nothing is left of a cut mesh: it lies down, and what was touched there is gone.
#include "conform_body.h"
#include "test.h"

#include <math.h>
#include <stdlib.h>

// How far tissue is from a place, in plan.
static double away_mm(const struct mesh *tissue, vec3 p) {
    double least = INFINITY;
    for (uint32_t v = 0; v < tissue->vertex_count; v++) {
        vec3 q = mesh_vertex(tissue, v);
        least = fmin(least, (p.x - q.x) * (p.x - q.x) + (p.y - q.y) * (p.y - q.y));
    }
    return sqrt(least);
}

// The vertices that are farther than that from all tissue.
static bool *lost_of(const struct body *b, const struct cut_state *cut, double mm) {
    bool *lost = calloc(b->whole.vertex_count, sizeof *lost);
    uint32_t count = 0;
    for (uint32_t v = 0; v < b->whole.vertex_count; v++)
        count += lost[v] = away_mm(&cut->mesh, mesh_vertex(&b->whole, v)) > mm;
    assert_true(count > 200);
    return lost;
}

// The lowest of S' about a place.
static double lowest(const struct mesh *mesh, vec3 p) {
    double least = INFINITY;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 q = mesh_vertex(mesh, v);
        if ((p.x - q.x) * (p.x - q.x) + (p.y - q.y) * (p.y - q.y) < 1)
            least = fmin(least, q.z);
    }
    return least;
}

static void where_nothing_is_left_the_touch_lies_on_the_underside(void **state) {
    (void)state;
    struct cut_state cut;
    struct body b;
    body_giving_meniscus(&b, 8);
    double whole = match_surface_volume(b.surface);
    body_take_section(&b, &cut);
    double lost_mm3 = whole - cut.volume;
    follow(b.conform, &cut, false);
    assert_true(body_apart_mm3(&b, &cut, true) > 0.4 * lost_mm3); // as it would be without
    conform_destroy(&b.conform);
    b.conform = conform_create(b.surface);
    struct conform_report report = follow(b.conform, &cut, true);
    assert_true(body_apart_mm3(&b, &cut, true) < 0.1 * lost_mm3);
    assert_true(report.sheet_mm3 > 1 && report.sheet_mm3 < 0.05 * lost_mm3);
    assert_near(report.left_mm3, report.sheet_mm3, 1e-9 * whole);
    assert_near(body_volume(&b), cut.volume + report.sheet_mm3, 1e-9 * whole);
    assert_int_equal(body_crossings(&b), 0);
    bool *lost = lost_of(&b, &cut, 9);
    for (uint32_t v = 0; v < b.whole.vertex_count; v++)
        if (lost[v]) {
            vec3 at = conform_vertex(b.conform, v), from = mesh_vertex(&b.whole, v);
            assert_true(at.x == from.x && at.y == from.y);
            assert_near(at.z, lowest(&b.whole, from), 1);
        }
    free(lost);
    cut_state_fini(&cut);
    body_fini(&b);
}

// What bites have shaped lies beside it, and makes room.
static void it_lies_down_after_bites_too(void **state) {
    (void)state;
    struct random r = {2}; // here smoothing is needed
    struct cut_state cut;
    struct body b;
    body_giving_meniscus(&b, 8);
    for (int i = 0; i < 24; i++)
        if (body_bite(&b, &r, &cut)) {
            follow(b.conform, &cut, true);
            cut_state_fini(&cut);
        }
    double before = cut_mesh_volume(b.cut);
    body_take_section(&b, &cut);
    follow(b.conform, &cut, true);
    assert_true(body_apart_mm3(&b, &cut, true) < 0.1 * (before - cut.volume));
    assert_int_equal(body_crossings(&b), 0);
    cut_state_fini(&cut);
    body_fini(&b);
}

static void nothing_sinks_farther_than_the_greatest_resection_moves_it(void **state) {
    (void)state;
    struct cut_state cut;
    struct body b;
    double deepest = 0;
    body_giving_meniscus(&b, 1.5);
    body_take_section(&b, &cut);
    follow(b.conform, &cut, true);
    bool *lost = lost_of(&b, &cut, 9);
    for (uint32_t v = 0; v < b.whole.vertex_count; v++)
        if (lost[v])
            deepest = fmax(deepest,
                           vec3_distance(conform_vertex(b.conform, v), mesh_vertex(&b.whole, v)));
    assert_near(deepest, 1.5, 1e-6);
    assert_int_equal(body_crossings(&b), 0);
    free(lost);
    cut_state_fini(&cut);
    body_fini(&b);
}

static void what_lies_down_stays_and_can_be_taken_back(void **state) {
    (void)state;
    struct random r = {3};
    struct cut_state cut, next;
    struct conform_past past[2];
    struct body b;
    body_giving_meniscus(&b, 8);
    struct conform *before = conform_copy(b.conform);
    body_take_section(&b, &cut);
    follow(b.conform, &cut, true);
    conform_past(b.conform, &past[0]);
    struct conform *laid = conform_copy(b.conform);
    bool *lost = lost_of(&b, &cut, 9);
    while (!body_bite(&b, &r, &next))
        ;
    follow(b.conform, &next, true);
    conform_past(b.conform, &past[1]);
    assert_false(same_bits(laid, b.conform, b.whole.vertex_count));
    for (uint32_t v = 0; v < b.whole.vertex_count; v++)
        if (lost[v])
            assert_true(vec3_distance(conform_vertex(laid, v), conform_vertex(b.conform, v)) == 0);
    conform_take_back(b.conform, &past[1]);
    assert_true(same_bits(laid, b.conform, b.whole.vertex_count));
    conform_take_back(b.conform, &past[0]);
    assert_true(same_bits(before, b.conform, b.whole.vertex_count));
    follow(b.conform, &cut, true);
    assert_true(same_bits(laid, b.conform, b.whole.vertex_count));
    for (int i = 0; i < 2; i++)
        conform_past_fini(&past[i]);
    free(lost);
    conform_destroy(&before);
    conform_destroy(&laid);
    cut_state_fini(&cut);
    cut_state_fini(&next);
    body_fini(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(where_nothing_is_left_the_touch_lies_on_the_underside),
        cmocka_unit_test(it_lies_down_after_bites_too),
        cmocka_unit_test(nothing_sinks_farther_than_the_greatest_resection_moves_it),
        cmocka_unit_test(what_lies_down_stays_and_can_be_taken_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
