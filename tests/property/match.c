#include "bench/bisection.h"
#include "random.h"
#include "scene/tissue.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

// ---- a nibble -----------------------------------------------------------------------------------

// Somewhere on what is left of the way of a vertex.
static struct brush random_brush(const struct tissue *tissue, struct random *r, double radius) {
    for (;;) {
        uint32_t v = (uint32_t)(random_bits(r) % tissue->mesh.vertex_count);
        double blend = match_blends(tissue->match)[v];
        if (tissue_way(tissue, v) * (1 - blend) < 0.2)
            continue;
        return (struct brush){tissue_place(tissue, v, random_between(r, blend, 1)), radius};
    }
}

static void check_changed(const struct tissue *tissue, const struct match_report *report) {
    const double *blends = match_blends(tissue->match);
    uint32_t listed = 0;
    for (uint32_t v = 0; v < tissue->mesh.vertex_count; v++) {
        bool in_list = listed < report->changed_count && report->changed[listed] == v;
        assert_int_equal(in_list, memcmp(&blends[v], &tissue->before[v], sizeof *blends) != 0);
        listed += in_list;
        assert_true(blends[v] >= tissue->before[v] && blends[v] <= 1);
        assert_vec3_near(match_vertex(tissue->match, v), tissue_place(tissue, v, blends[v]), 0);
    }
    assert_int_equal(listed, report->changed_count);
}

// Matches, and holds all that must always hold.
static struct match_report nibble(struct tissue *tissue, const struct brush *brushes, int count,
                                  double target) {
    struct match_report report;
    tissue_remember(tissue);
    match_to_volume(tissue->match, brushes, count, target, &report);
    double whole = match_surface_volume(tissue->surface);
    double volume = tissue_volume(tissue, match_blends(tissue->match));
    assert_near(report.volume_mm3, volume, 1e-13 * whole);
    assert_near(match_volume(tissue->match), volume, 1e-13 * whole);
    assert_near(report.left_mm3, report.volume_mm3 - target, 1e-13 * whole);
    if (report.outcome == MATCH_REACHED && report.scale > 0)
        assert_near(volume, target, 1e-13 * whole);
    if (report.outcome == MATCH_SATURATED) {
        assert_true(report.left_mm3 > 0);
        assert_near(report.widening, MATCH_WIDENING_MAX, 0);
    }
    check_changed(tissue, &report);
    return report;
}

static void check_sequence(struct tissue *tissue, uint64_t seed, int *reached, int *saturated) {
    struct random r = {seed};
    double removed = 0,
           room = match_surface_volume(tissue->surface) - match_surface_least(tissue->surface);
    assert_true(room > 100);
    for (int i = 0; i < 150; i++) {
        double now = match_volume(tissue->match), bite = random_between(&r, 0.001, 0.03) * room;
        if (now - match_surface_least(tissue->surface) < 0.05 * room)
            break;
        struct brush brush = random_brush(tissue, &r, random_between(&r, 0.3, 4));
        struct match_report report = nibble(tissue, &brush, 1, now - bite);
        ++*(report.outcome == MATCH_REACHED ? reached : saturated);
        removed += now - report.volume_mm3;
    }
    assert_near(match_volume(tissue->match), match_surface_volume(tissue->surface) - removed, 1e-9);
}

static void each_nibble_takes_what_the_cut_took(void **state) {
    (void)state;
    struct tissue tissue;
    int reached = 0, saturated = 0;
    tissue_sphere(&tissue, 12, 5);
    check_sequence(&tissue, 1, &reached, &saturated);
    tissue_fini(&tissue);
    tissue_meniscus(&tissue);
    check_sequence(&tissue, 2, &reached, &saturated);
    tissue_fini(&tissue);
    assert_true(reached > 60 && saturated > 0);
}

// ---- the volume over s --------------------------------------------------------------------------

// The first sample at which the volume is at the target or below it; 0 where there is none.
static int first_crossing(const double *volumes, int count, double target) {
    for (int i = 1; i < count; i++)
        if (volumes[i] <= target)
            return i;
    return 0;
}

enum { SAMPLES = 2001 };

// True where the volume rises somewhere.
static bool sample_volumes(const struct tissue *tissue, const struct brush *brush,
                           double out_volumes[SAMPLES]) {
    double *falloffs = tissue_falloffs(tissue, brush, 1, 1);
    bool rises = false;
    for (int i = 0; i < SAMPLES; i++) {
        out_volumes[i] = tissue_volume_at(tissue, falloffs, i / (SAMPLES - 1.0));
        rises |= i && out_volumes[i] > out_volumes[i - 1] + 1e-9;
    }
    free(falloffs);
    return rises;
}

static double least_of(const double *volumes) {
    double least = volumes[0];
    for (int i = 0; i < SAMPLES; i++)
        least = fmin(least, volumes[i]);
    return least;
}

// Blends that are not 0, so that vertices stop one after the other.
static void raise_some(struct tissue *tissue, struct random *r) {
    for (int i = 0; i < 3; i++) {
        struct brush brush = random_brush(tissue, r, 6);
        nibble(tissue, &brush, 1, match_volume(tissue->match) - random_between(r, 1, 20));
    }
    tissue_remember(tissue);
}

static void check_smallest_scale(struct tissue *tissue, const struct brush *brush, struct random *r,
                                 int *rises, int *dips) {
    double volumes[SAMPLES];
    *rises += sample_volumes(tissue, brush, volumes);
    double least = least_of(volumes);
    double target = least + random_between(r, 0.05, 0.95) * (volumes[0] - least);
    *dips += volumes[SAMPLES - 1] > target;
    struct match_report report = nibble(tissue, brush, 1, target);
    int crossing = first_crossing(volumes, SAMPLES, target);
    assert_int_equal(report.outcome, MATCH_REACHED);
    assert_near(report.widening, 1, 0);
    assert_near(report.scale * (SAMPLES - 1), crossing - 0.5, 0.5 + 1e-6);
}

static void the_smallest_scale_is_taken_where_the_volume_falls(void **state) {
    (void)state;
    struct random r = {3};
    int rises = 0, dips = 0;
    for (int i = 0; i < 15; i++) {
        struct tissue tissue;
        tissue_sphere(&tissue, 7, 5);
        raise_some(&tissue, &r);
        struct brush brush = random_brush(&tissue, &r, random_between(&r, 3, 8));
        check_smallest_scale(&tissue, &brush, &r, &rises, &dips);
        tissue_fini(&tissue);
    }
    assert_int_equal(dips, 0);
}

static void the_smallest_scale_is_taken_where_the_volume_rises_and_falls(void **state) {
    (void)state;
    struct random r = {4};
    int rises = 0, dips = 0;
    for (int i = 0; i < 40; i++) {
        struct tissue tissue;
        tissue_uneven(&tissue, 7, 100 + (uint64_t)i);
        vec3 centre = vec3_scale(9, random_direction(&r));
        centre.x = random_between(&r, -4, 0); // where it recedes, beside where it swells
        struct brush brush = {centre, random_between(&r, 4, 8)};
        check_smallest_scale(&tissue, &brush, &r, &rises, &dips);
        tissue_fini(&tissue);
    }
    assert_true(rises >= 12 && dips >= 5);
}

// A target that is met just where a vertex reaches S'_max.
static void breakpoints_are_exact(void **state) {
    (void)state;
    struct random r = {5};
    for (int i = 0; i < 40; i++) {
        struct tissue tissue;
        tissue_sphere(&tissue, 7, 5);
        raise_some(&tissue, &r);
        struct brush brush = random_brush(&tissue, &r, 5);
        double *b = tissue_falloffs(&tissue, &brush, 1, 1);
        uint32_t v;
        do
            v = (uint32_t)(random_bits(&r) % tissue.mesh.vertex_count);
        while (!(b[v] > 0 && tissue.before[v] + b[v] > 1));
        double bound = (1 - tissue.before[v]) / b[v];
        struct match_report report =
            nibble(&tissue, &brush, 1, tissue_volume_at(&tissue, b, bound));
        assert_near(report.scale, bound, 1e-9);
        assert_near(match_blends(tissue.match)[v], 1, 1e-9);
        for (uint32_t w = 0; w < tissue.mesh.vertex_count; w++)
            assert_near(match_blends(tissue.match)[w], fmin(tissue.before[w] + bound * b[w], 1),
                        1e-8);
        free(b);
        tissue_fini(&tissue);
    }
}

static void of_several_brushes_a_vertex_gets_the_highest(void **state) {
    (void)state;
    struct random r = {6};
    for (int i = 0; i < 20; i++) {
        struct tissue tissue;
        tissue_sphere(&tissue, 8, 5);
        struct brush brushes[3];
        for (int k = 0; k < 3; k++)
            brushes[k] = random_brush(&tissue, &r, random_between(&r, 3, 7));
        double *b = tissue_falloffs(&tissue, brushes, 3, 1);
        double full = tissue_volume_at(&tissue, b, 1), whole = match_volume(tissue.match);
        struct match_report report =
            nibble(&tissue, brushes, 3, whole - random_between(&r, 0.1, 0.9) * (whole - full));
        for (uint32_t v = 0; v < tissue.mesh.vertex_count; v++)
            assert_near(match_blends(tissue.match)[v], fmin(report.scale * b[v], 1), 1e-9);
        free(b);
        tissue_fini(&tissue);
    }
}

// ---- what cannot be given -----------------------------------------------------------------------

static void a_brush_widens_before_it_gives_up(void **state) {
    (void)state;
    struct tissue tissue;
    tissue_sphere(&tissue, 10, 5);
    struct brush brush = {tissue_place(&tissue, 0, 0.5), 2};
    double *narrow = tissue_falloffs(&tissue, &brush, 1, 1);
    double *wide = tissue_falloffs(&tissue, &brush, 1, 1.5);
    double high = tissue_volume_at(&tissue, narrow, 1), low = tissue_volume_at(&tissue, wide, 1);
    assert_true(low < high);
    struct match_report report = nibble(&tissue, &brush, 1, (high + low) / 2);
    assert_int_equal(report.outcome, MATCH_REACHED);
    assert_near(report.widening, 1.5, 0);
    for (uint32_t v = 0; v < tissue.mesh.vertex_count; v++)
        assert_near(match_blends(tissue.match)[v], fmin(report.scale * wide[v], 1), 1e-9);
    free(narrow);
    free(wide);
    tissue_fini(&tissue);
}

static void what_a_brush_cannot_give_is_left_over(void **state) {
    (void)state;
    struct tissue tissue;
    tissue_sphere(&tissue, 10, 5);
    struct brush brush = {tissue_place(&tissue, 0, 0.5), 2};
    double *b = tissue_falloffs(&tissue, &brush, 1, MATCH_WIDENING_MAX);
    double least = tissue_volume_at(&tissue, b, 1);
    struct match_report report = nibble(&tissue, &brush, 1, least - 5);
    assert_int_equal(report.outcome, MATCH_SATURATED);
    assert_near(report.left_mm3, 5, 1e-9);
    assert_near(report.scale, 1, 0);
    free(b);
    tissue_fini(&tissue);
}

// Brushes everywhere take all, and then there is no more to give.
static void a_whole_resection_ends_at_the_least_volume(void **state) {
    (void)state;
    struct tissue tissue;
    tissue_sphere(&tissue, 8, 5);
    double least = match_surface_least(tissue.surface);
    struct brush brush = {{0, 0, 8}, 30};
    for (int i = 0; i < 3; i++) {
        struct match_report report = nibble(&tissue, &brush, 1, least - 1);
        assert_int_equal(report.outcome, MATCH_SATURATED);
        assert_near(report.left_mm3, 1, 1e-9);
        assert_int_equal(report.changed_count != 0, i == 0);
    }
    for (uint32_t v = 0; v < tissue.mesh.vertex_count; v++)
        assert_true(match_blends(tissue.match)[v] == (tissue_way(&tissue, v) > 0 ? 1 : 0));
    assert_near(match_volume(tissue.match), least, 1e-10);
    tissue_fini(&tissue);
}

// Where the volume can only rise, nothing is the most that can be given.
static void a_way_that_only_adds_is_not_gone(void **state) {
    (void)state;
    struct tissue tissue;
    tissue_sphere(&tissue, 6, -3);
    struct brush brush = {{0, 0, 11}, 4};
    double volume = match_volume(tissue.match);
    struct match_report report = nibble(&tissue, &brush, 1, volume - 2);
    assert_int_equal(report.outcome, MATCH_SATURATED);
    assert_near(report.left_mm3, 2, 1e-9);
    assert_int_equal(report.changed_count, 0);
    tissue_fini(&tissue);
}

static void without_a_brush_nothing_is_given(void **state) {
    (void)state;
    struct tissue tissue;
    tissue_sphere(&tissue, 6, 5);
    struct match_report report = nibble(&tissue, NULL, 0, match_volume(tissue.match) - 2);
    assert_int_equal(report.outcome, MATCH_SATURATED);
    assert_near(report.left_mm3, 2, 1e-10);
    assert_int_equal(report.changed_count, 0);
    tissue_fini(&tissue);
}

static void a_target_above_the_volume_changes_nothing(void **state) {
    (void)state;
    struct random r = {8};
    struct tissue tissue;
    tissue_sphere(&tissue, 6, 5);
    raise_some(&tissue, &r);
    struct brush brush = random_brush(&tissue, &r, 4);
    double volume = match_volume(tissue.match);
    struct match_report report = nibble(&tissue, &brush, 1, volume + 3);
    assert_int_equal(report.outcome, MATCH_REACHED);
    assert_near(report.left_mm3, -3, 1e-10);
    assert_int_equal(report.changed_count, 0);
    tissue_fini(&tissue);
}

// ---- where it recedes ---------------------------------------------------------------------------

// Deep under S', where the vertices of the first bites have come to.
static void a_second_bite_in_the_same_place_goes_deeper(void **state) {
    (void)state;
    struct tissue tissue;
    tissue_sphere(&tissue, 14, 5);
    for (double depth = 0.2; depth < 0.9; depth += 0.2) {
        struct brush brush = {tissue_place(&tissue, 0, depth), 1.2};
        double before = match_blends(tissue.match)[0];
        struct match_report report = nibble(&tissue, &brush, 1, match_volume(tissue.match) - 0.4);
        assert_near(report.widening, 1, 0);
        double gain = match_blends(tissue.match)[0] - before;
        assert_true(gain > 0);
        for (uint32_t i = 0; i < report.changed_count; i++) {
            uint32_t v = report.changed[i];
            assert_true(match_blends(tissue.match)[v] - tissue.before[v] <= gain);
            assert_true(vec3_distance(tissue_place(&tissue, v, 0), tissue_place(&tissue, 0, 0)) <
                        3);
        }
    }
    tissue_fini(&tissue);
}

static void a_cut_finer_than_the_mesh_is_matched(void **state) {
    (void)state;
    struct random r = {9};
    struct tissue tissue;
    tissue_sphere(&tissue, 5, 5);
    for (int i = 0; i < 60; i++) {
        uint32_t *corners =
            tissue.mesh.triangles + 3 * (random_bits(&r) % tissue.mesh.triangle_count);
        struct brush brush = {{0}, 1e-3};
        for (int k = 0; k < 3; k++)
            brush.centre =
                vec3_add_scaled(brush.centre, 1.0 / 3, match_vertex(tissue.match, corners[k]));
        if (brush.centre.z < 3)
            continue;
        struct match_report report = nibble(&tissue, &brush, 1, match_volume(tissue.match) - 1e-3);
        assert_int_equal(report.outcome, MATCH_REACHED);
        assert_true(report.changed_count > 0);
    }
    tissue_fini(&tissue);
}

// ---- bits, and the paper's own way --------------------------------------------------------------

static void the_same_calls_give_the_same_bits(void **state) {
    (void)state;
    struct tissue a, b;
    tissue_meniscus(&a);
    tissue_meniscus(&b);
    struct random r = {10};
    for (int i = 0; i < 60; i++) {
        struct brush brushes[2] = {random_brush(&a, &r, random_between(&r, 0.5, 3)),
                                   random_brush(&a, &r, random_between(&r, 0.5, 3))};
        double target = match_volume(a.match) - random_between(&r, 0, 4);
        struct match_report one = nibble(&a, brushes, 2, target);
        struct match_report two = nibble(&b, brushes, 2, target);
        assert_memory_equal(&one.volume_mm3, &two.volume_mm3, sizeof one.volume_mm3);
        assert_memory_equal(&one.scale, &two.scale, sizeof one.scale);
        assert_memory_equal(match_blends(a.match), match_blends(b.match),
                            a.mesh.vertex_count * sizeof(double));
    }
    tissue_fini(&a);
    tissue_fini(&b);
}

static void bisection_finds_the_same(void **state) {
    (void)state;
    struct tissue a;
    tissue_meniscus(&a);
    struct bisection *b = bisection_create(&a.mesh, a.warp, a.maxcut);
    struct random r = {11};
    for (int i = 0; i < 40; i++) {
        struct brush brush = random_brush(&a, &r, random_between(&r, 0.5, 3));
        double target = match_volume(a.match) - random_between(&r, 0, 4);
        struct match_report ours = nibble(&a, &brush, 1, target), theirs;
        bisection_match(b, &brush, 1, target, 1e-10, &theirs);
        assert_int_equal(theirs.outcome, ours.outcome);
        assert_near(theirs.widening, ours.widening, 0);
        assert_near(theirs.volume_mm3, ours.volume_mm3, 2e-10);
        assert_near(theirs.volume_mm3, bisection_volume(b), 1e-9);
        for (uint32_t v = 0; v < a.mesh.vertex_count; v++)
            assert_near(bisection_blends(b)[v], match_blends(a.match)[v], 1e-6);
    }
    tissue_fini(&a);
    bisection_destroy(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_nibble_takes_what_the_cut_took),
        cmocka_unit_test(the_smallest_scale_is_taken_where_the_volume_falls),
        cmocka_unit_test(the_smallest_scale_is_taken_where_the_volume_rises_and_falls),
        cmocka_unit_test(breakpoints_are_exact),
        cmocka_unit_test(of_several_brushes_a_vertex_gets_the_highest),
        cmocka_unit_test(a_brush_widens_before_it_gives_up),
        cmocka_unit_test(what_a_brush_cannot_give_is_left_over),
        cmocka_unit_test(a_whole_resection_ends_at_the_least_volume),
        cmocka_unit_test(a_way_that_only_adds_is_not_gone),
        cmocka_unit_test(without_a_brush_nothing_is_given),
        cmocka_unit_test(a_target_above_the_volume_changes_nothing),
        cmocka_unit_test(a_second_bite_in_the_same_place_goes_deeper),
        cmocka_unit_test(a_cut_finer_than_the_mesh_is_matched),
        cmocka_unit_test(the_same_calls_give_the_same_bits),
        cmocka_unit_test(bisection_finds_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
