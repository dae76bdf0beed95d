// The scope's view, triangulation and touches.

#include "base/clock.h"
#include "metrics/touch.h"
#include "metrics/view.h"
#include "random.h"
#include "test.h"

#define MS NS_PER_MS

// ---- the cone -----------------------------------------------------------------------------------

static vec3 at_angle(double towards_y_deg, double distance) {
    double a = towards_y_deg * RAD_PER_DEG;
    return (vec3){0, distance * sin(a), distance * cos(a)};
}

static void a_tilted_optic_looks_to_its_side(void **state) {
    (void)state;
    const struct {
        double tilt, field, angle, distance;
        bool shown;
    } rows[] = {
        {30, 90, 30, 20, true},    {30, 90, 74.9, 20, true},   {30, 90, 75.1, 20, false},
        {30, 90, -14.9, 20, true}, {30, 90, -15.1, 20, false}, {30, 90, 180, 20, false},
        {70, 90, 70, 20, true},    {70, 90, 0, 20, false},     {70, 90, 25.1, 20, true},
        {70, 90, 114.9, 20, true}, {0, 60, 29.9, 20, true},    {0, 60, -30.1, 20, false},
        {30, 90, 30, 49.9, true},  {30, 90, 30, 50.1, false},  {30, 90, 30, 0, true},
    };
    struct random r = {1};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct view_optic optic = {rows[i].tilt, rows[i].field};
        pose scope = random_pose(&r, 100);
        vec3 tip = pose_apply(scope, at_angle(rows[i].angle, rows[i].distance));
        if (view_shows(&optic, scope, tip) != rows[i].shown)
            fail_msg("row %zu", i);
    }
}

// In the scope's frame, by an angle and not by a cosine.
static bool shown_by_angle(const struct view_optic *optic, pose scope, vec3 tip) {
    vec3 p = pose_apply(pose_inverse(scope), tip), axis = at_angle(optic->tilt_deg, 1);
    double angle = atan2(vec3_length(vec3_cross(axis, p)), vec3_dot(axis, p));
    return vec3_length(p) <= 50 && angle <= 0.5 * optic->field_deg * RAD_PER_DEG;
}

static void the_cone_is_round(void **state) {
    (void)state;
    struct random r = {2};
    int shown = 0;
    for (int i = 0; i < 20000; i++) {
        struct view_optic optic = {random_between(&r, 0, 90), random_between(&r, 20, 170)};
        pose scope = random_pose(&r, 20);
        vec3 tip = random_in_box(&r, 40);
        bool shows = view_shows(&optic, scope, tip);
        assert_int_equal(shows, shown_by_angle(&optic, scope, tip));
        shown += shows;
    }
    assert_in_range(shown, 2000, 18000);
}

// ---- triangulation ------------------------------------------------------------------------------

// A letter for each 100 ms: '.' not there, 'o' out of view, 'v' in view.
static struct search searched(const char *text) {
    struct search s;
    search_init(&s);
    for (int i = 0; text[i]; i++)
        search_step(&s, 5 * NS_PER_S + i * 100 * MS, text[i] != '.', text[i] == 'v');
    return s;
}

static void a_search_ends_when_the_tip_stays_in_view(void **state) {
    (void)state;
    const struct {
        const char *text;
        int found;
        double first_s, mean_s;
    } rows[] = {
        {"oooo", 0, NAN, NAN},
        {"....", 0, NAN, NAN},
        {"oovvvvv", 0, NAN, NAN},                    // not yet for half a second
        {"oovvvvvv", 1, 0.2, 0.2},                   // so long
        {"oovvvoovvvvvv", 1, 0.7, 0.7},              // a glimpse is nothing
        {"vvvvvvvv", 1, 0, 0},                       // at once
        {"ovvvvvvoooovvvvvv", 1, 0.1, 0.1},          // not gone for a second
        {"ovvvvvvoooooooooooovvvvvv", 2, 0.1, 0.65}, // gone, and found again after 1.2 s
        {"oooooo..oovvvvvv", 1, 0.2, 0.2},           // given up; the next one counts
        {"ovvvvvv..ooovvvvvv", 2, 0.1, 0.2},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct search s = searched(rows[i].text);
        if (s.found != rows[i].found)
            fail_msg("%s: %d found", rows[i].text, s.found);
        if (!rows[i].found) {
            assert_true(isnan(search_first_s(&s)) && isnan(search_mean_s(&s)));
            continue;
        }
        assert_near(search_first_s(&s), rows[i].first_s, 1e-9);
        assert_near(search_mean_s(&s), rows[i].mean_s, 1e-9);
    }
}

// ---- touches ------------------------------------------------------------------------------------

static void touch(struct touch *t, int64_t *time_ns, int group, double mm, double depth) {
    *time_ns += 50 * MS;
    touch_step(t, *time_ns, group, mm);
    touch_pass(t, group, depth, 50 * MS);
}

static void a_touch_counts_once_for_each_group_that_it_is_of(void **state) {
    (void)state;
    struct touch t;
    int64_t time_ns = NS_PER_S;
    touch_init(&t);
    const struct {
        int group;
        double mm;
    } steps[] = {
        {3, 0.5},  {3, 0.19}, {3, 0.3},       {3, 0.1},                 // however it shakes
        {2, 0.1},  {3, 0.1},  {2, 0.1},                                 // along a seam
        {2, 0.41}, {2, 0.3},  {-1, INFINITY}, {3, 0.1},       {2, 0.1}, // left for 150 ms
        {2, 0.41}, {2, 0.3},  {-1, INFINITY}, {-1, INFINITY}, {3, 0.1}, // for 200
    };
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++)
        touch(&t, &time_ns, steps[i].group, steps[i].mm, 0);
    assert_int_equal(t.groups[3].count, 2);
    assert_int_equal(t.groups[2].count, 1);
    assert_int_equal(t.groups[3].touching_ns, 6 * 50 * MS);
    assert_int_equal(t.groups[2].touching_ns, 3 * 50 * MS);
    assert_true(t.groups[0].count == 0 && t.groups[0].touching_ns == 0);
}

static void depths_are_sorted_by_how_deep(void **state) {
    (void)state;
    struct touch t;
    int64_t time_ns = NS_PER_S;
    touch_init(&t);
    const double depths[] = {0, 0.05, 0.1, 0.3, 0.49, 0.5, 0.99, 1, 7};
    for (size_t i = 0; i < sizeof depths / sizeof *depths; i++)
        touch(&t, &time_ns, 1, 5, depths[i]); // a shaft, its tip far away
    touch(&t, &time_ns, -1, INFINITY, 9);
    assert_int_equal(t.groups[1].deep_ns[0], 3 * 50 * MS);
    assert_int_equal(t.groups[1].deep_ns[1], 2 * 50 * MS);
    assert_int_equal(t.groups[1].deep_ns[2], 2 * 50 * MS);
    assert_true(t.groups[1].deepest_mm == 7);
    assert_int_equal(t.groups[1].touching_ns, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tilted_optic_looks_to_its_side),
        cmocka_unit_test(the_cone_is_round),
        cmocka_unit_test(a_search_ends_when_the_tip_stays_in_view),
        cmocka_unit_test(a_touch_counts_once_for_each_group_that_it_is_of),
        cmocka_unit_test(depths_are_sorted_by_how_deep),
    };
    return cmocka_run_group_tests_name("metrics_view", tests, NULL, NULL);
}
