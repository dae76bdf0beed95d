#include "generate/tear.h"

#include "cut/cut.h"
#include "generate/generate.h"
#include "generate/maxcut.h"
#include "mesh/topology.h"
#include "random.h"
#include "test.h"
#include "winding.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const recipes[] = {"tear-radial", "tear-flap", "tear-bucket-handle",
                                      "tear-horizontal", "tear-arthrosis"};

#define RECIPE_COUNT 5

static struct recipe recipe_of[RECIPE_COUNT];
static struct knee_case *knees[RECIPE_COUNT];
static struct arc *arcs[RECIPE_COUNT];
static struct mesh tissues[RECIPE_COUNT]; // S'

static struct tear *tear_of(struct recipe *recipe) {
    for (int i = 0; i < recipe->step_count; i++)
        if (recipe->steps[i].kind == PATHOLOGY_TEAR)
            return &recipe->steps[i].tear.tear;
    fail();
    return NULL;
}

static int make_knees(void **state) {
    (void)state;
    struct error err;
    for (int i = 0; i < RECIPE_COUNT; i++) {
        char path[512];
        snprintf(path, sizeof path, "%s/%s", CASES, recipes[i]);
        bool loaded = recipe_load(path, &recipe_of[i], &err) == RESULT_OK;
        recipe_of[i].resolution_mm = 2.4; // for speed
        if (!loaded || generate_knee(&recipe_of[i], &knees[i], &err) != RESULT_OK) {
            printf("%s\n", err.text);
            return -1;
        }
        case_group_virtual(case_group(knees[i], "meniscus_medial"), &tissues[i]);
        if (arc_create(&tissues[i], pose_identity(), &arcs[i], &err) != RESULT_OK)
            return -1;
    }
    return 0;
}

static int destroy_knees(void **state) {
    (void)state;
    for (int i = 0; i < RECIPE_COUNT; i++) {
        arc_destroy(&arcs[i]);
        mesh_fini(&tissues[i]);
        case_destroy(&knees[i]);
    }
    return 0;
}

static const struct case_lesion *lesion_of(int i) {
    return &case_group(knees[i], "meniscus_medial")->lesion;
}

static bool is_in(const struct case_region *region, vec3 p) {
    for (int i = 0; i < region->part_count; i++)
        if (convex_contains(&region->parts[i], p))
            return true;
    return false;
}

// ---- all of them --------------------------------------------------------------------------------

static void every_recipe_has_one_lesion_of_few_parts(void **state) {
    (void)state;
    for (int i = 0; i < RECIPE_COUNT; i++) {
        const struct case_lesion *lesion = lesion_of(i);
        assert_true(lesion->tear.part_count >= 1 && lesion->tear.part_count <= CUT_PARTS_MAX);
        assert_true(lesion->damage.part_count >= 1 && lesion->damage.part_count <= 8);
        assert_true(lesion->plan.part_count >= 5 && lesion->plan.part_count <= 8);
        assert_int_equal(case_group(knees[i], "meniscus_lateral")->lesion.plan.part_count, 0);
    }
    assert_null(case_group(knees[0], "meniscus_medial")->warp);
    assert_non_null(case_group(knees[4], "meniscus_medial")->warp);
}

static void a_cleft_is_thin_and_leaves_one_piece(void **state) {
    (void)state;
    for (int i = 0; i < RECIPE_COUNT; i++) {
        const struct case_lesion *lesion = lesion_of(i);
        struct cut_mesh *cut;
        struct cut_change change = {0};
        struct error err;
        assert_int_equal(cut_mesh_create(&tissues[i], &cut, &err), RESULT_OK);
        if (cut_apply(cut, lesion->tear.parts, lesion->tear.part_count, &change, &err) !=
            CUT_CHANGED)
            fail_msg("%s: %s", recipes[i], err.text);
        assert_int_equal(change.piece_count, 0);
        assert_true(change.removed_mm3 > 0.5 && change.removed_mm3 < 15);
        struct mesh torn;
        cut_mesh_flatten(cut, &torn, NULL, NULL);
        struct topology t = topology_of(&torn);
        assert_true(t.closed && t.manifold && t.oriented);
        assert_int_equal(t.components, 1);
        // Only a bucket handle has a hole through which one can look.
        assert_int_equal(t.genus, tear_of(&recipe_of[i])->kind == TEAR_BUCKET_HANDLE);
        mesh_fini(&torn);
        cut_change_fini(&change);
        cut_mesh_destroy(&cut);
    }
}

// A point of the part, and of the tissue.
static vec3 point_in(struct random *r, const struct convex *part, const struct mesh *tissue) {
    for (;;) {
        vec3 sum = {0};
        double weights = 0;
        for (int i = 0; i < part->vertex_count; i++) {
            double weight = random_between(r, 0, 1);
            sum = vec3_add_scaled(sum, weight, part->vertices[i]);
            weights += weight;
        }
        vec3 p = vec3_scale(1 / weights, sum);
        if (is_inside(tissue, p))
            return p;
    }
}

static void the_plan_holds_the_damage_and_the_damage_the_cleft(void **state) {
    (void)state;
    struct random r = {3};
    for (int i = 0; i < RECIPE_COUNT; i++) {
        const struct case_lesion *lesion = lesion_of(i);
        for (int k = 0; k < 100 * lesion->damage.part_count; k++) {
            vec3 p = point_in(&r, &lesion->damage.parts[k / 100], &tissues[i]);
            assert_true(is_in(&lesion->plan, p));
        }
        for (int k = 0; k < 50 * lesion->tear.part_count; k++) {
            vec3 p = point_in(&r, &lesion->tear.parts[k / 50], &tissues[i]);
            assert_true(is_in(&lesion->plan, p) && is_in(&lesion->damage, p));
        }
        // Corners lie where random points seldom do.
        for (int k = 0; k < lesion->damage.part_count; k++)
            for (int v = 0; v < lesion->damage.parts[k].vertex_count; v++) {
                vec3 p = lesion->damage.parts[k].vertices[v];
                assert_true(is_in(&lesion->plan, p) || !is_inside(&tissues[i], p));
            }
    }
}

static void the_plan_lies_within_the_cut_budget(void **state) {
    (void)state;
    for (int i = 0; i < RECIPE_COUNT; i++) {
        struct maxcut_report report;
        struct error err;
        assert_int_equal(maxcut_inspect(case_group(knees[i], "meniscus_medial"), &report, &err),
                         RESULT_OK);
        assert_true(report.plan_mm3 > 80 && report.plan_mm3 < 300);
        assert_true(report.plan_beyond_mm3 < 0.02 * report.plan_mm3);
    }
}

// ---- what each is called for --------------------------------------------------------------------

// mm along the arc at the tear's depth, mm from the inner margin, share of the height.
static vec3 point_of(int i, double offset, double depth, double up) {
    const struct tear *tear = tear_of(&recipe_of[i]);
    double radius = arc_radius(arcs[i], tear->at) - arc_width(arcs[i], tear->at) + tear->depth_mm;
    double along = tear->at + offset / radius / arc_angle(arcs[i]), lower, upper;
    double inward = arc_width(arcs[i], along) - depth;
    arc_heights(arcs[i], along, inward, &lower, &upper);
    return arc_point(arcs[i], (struct arc_place){along, inward, lower + up * (upper - lower)});
}

static bool is_torn(int i, double offset, double depth, double up) {
    return is_in(&lesion_of(i)->tear, point_of(i, offset, depth, up));
}

// Whether the cleft is met between two depths.
static bool is_torn_between(int i, double offset, double from, double to, double up) {
    for (double depth = from; depth <= to; depth += 0.02)
        if (is_torn(i, offset, depth, up))
            return true;
    return false;
}

static void a_radial_tear_runs_from_the_inner_margin_outwards(void **state) {
    (void)state;
    double depth = tear_of(&recipe_of[0])->depth_mm;
    for (double up = 0.1; up < 1; up += 0.2) {
        for (double d = 0.1; d < depth; d += 0.2)
            assert_true(is_torn(0, 0, d, up));
        assert_false(is_torn_between(0, 0, depth + 0.2, depth + 5, up));
        for (double offset = -3; offset <= 3; offset += 0.5)
            assert_true(fabs(offset) < 0.3 || !is_torn_between(0, offset, 0, 8, up));
    }
}

static void a_flap_is_cut_from_the_margin_and_hangs_on_at_its_end(void **state) {
    (void)state;
    const struct tear *tear = tear_of(&recipe_of[1]);
    double half = tear->length_mm / 2;
    for (double up = 0.1; up < 1; up += 0.2) {
        for (double offset = 0.3; offset < tear->depth_mm; offset += 0.3)
            assert_true(is_torn_between(1, offset - half, offset - 0.7, offset + 0.7, up));
        for (double offset = tear->depth_mm - half; offset < half - 0.1; offset += 0.3)
            assert_true(is_torn_between(1, offset, tear->depth_mm - 0.4, tear->depth_mm + 0.1, up));
        assert_false(is_torn_between(1, half - 1, 0, tear->depth_mm - 1, up));
        assert_false(is_torn_between(1, half + 0.5, 0, 9, up));
    }
}

static void a_bucket_handle_is_cut_off_along_the_body_but_for_its_ends(void **state) {
    (void)state;
    const struct tear *tear = tear_of(&recipe_of[2]);
    double half = tear->length_mm / 2;
    for (double up = 0.1; up < 1; up += 0.2)
        for (double offset = -half - 3; offset <= half + 3; offset += 0.25) {
            bool torn = is_torn_between(2, offset, tear->depth_mm - 0.5, tear->depth_mm + 0.1, up);
            if (fabs(offset) < half - 0.1)
                assert_true(torn);
            if (fabs(offset) > half + 0.2)
                assert_false(torn);
            assert_false(is_torn_between(2, offset, 0, tear->depth_mm - 0.6, up));
        }
}

static void a_horizontal_tear_parts_an_upper_from_a_lower_leaf(void **state) {
    (void)state;
    const struct tear *tear = tear_of(&recipe_of[3]);
    for (double offset = -tear->length_mm / 2; offset <= tear->length_mm / 2; offset += 0.5)
        for (double depth = 0.8; depth < tear->depth_mm - 0.3; depth += 0.2) {
            int met = 0;
            for (double up = 0.02; up < 1; up += 0.01)
                met += is_torn(3, offset, depth, up);
            assert_true(met >= 1);
            assert_false(is_torn(3, offset, depth, 0.15) || is_torn(3, offset, depth, 0.85));
        }
    assert_false(is_torn_between(3, 0, tear->depth_mm + 0.3, 9, 0.5));
}

// ---- what does not fit --------------------------------------------------------------------------

static void a_tear_that_does_not_fit_is_refused_by_name(void **state) {
    (void)state;
    static const struct {
        struct tear tear;
        const char *says;
    } rows[] = {
        {{TEAR_RADIAL, 0.5, 8.5, 0}, "depth_mm = 8.5: at 0.50 of the arc"},
        {{TEAR_BUCKET_HANDLE, 0.2, 4, 30}, "reaches an end"},
        {{TEAR_FLAP, 0.5, 4, 3}, "a flap is longer than deep"},
    };
    struct recipe recipe = recipe_of[0];
    recipe.resolution_mm = 3;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct knee_case *knee;
        struct error err;
        *tear_of(&recipe) = rows[i].tear;
        assert_int_equal(generate_knee(&recipe, &knee, &err), RESULT_INVALID);
        assert_null(knee);
        if (!strstr(err.text, rows[i].says) || !strstr(err.text, "[tear radial] "))
            fail_msg("\"%s\" does not say \"%s\"", err.text, rows[i].says);
    }
}

static void a_plan_never_reaches_into_the_rim(void **state) {
    (void)state;
    struct recipe recipe = recipe_of[0];
    struct knee_case *knee;
    struct maxcut_report report;
    struct error err;
    tear_of(&recipe)->depth_mm = 7;
    assert_int_equal(generate_knee(&recipe, &knee, &err), RESULT_OK);
    struct case_group *group = case_group(knee, "meniscus_medial");
    assert_int_equal(maxcut_inspect(group, &report, &err), RESULT_OK);
    assert_true(report.plan_mm3 > 120);
    assert_true(report.plan_beyond_mm3 < 0.02 * report.plan_mm3);
    case_destroy(&knee);
}

static void a_left_knee_is_torn_as_the_right_one(void **state) {
    (void)state;
    for (int i = 1; i < RECIPE_COUNT; i += 2) {
        struct recipe recipe = recipe_of[i];
        struct knee_case *left;
        struct error err;
        recipe.side = SIDE_LEFT;
        assert_int_equal(generate_knee(&recipe, &left, &err), RESULT_OK);
        const struct case_lesion *a = &case_group(left, "meniscus_medial")->lesion;
        const struct case_lesion *b = lesion_of(i);
        assert_int_equal(a->tear.part_count, b->tear.part_count);
        assert_int_equal(a->plan.part_count, b->plan.part_count);
        for (int k = 0; k < a->plan.part_count; k++) {
            assert_near(a->plan.parts[k].volume, b->plan.parts[k].volume, 0.05);
            assert_near(a->plan.parts[k].box.min.x, -b->plan.parts[k].box.max.x, 0.01);
        }
        for (int k = 0; k < a->tear.part_count; k++)
            assert_near(a->tear.parts[k].box.max.x, -b->tear.parts[k].box.min.x, 0.01);
        case_destroy(&left);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recipe_has_one_lesion_of_few_parts),
        cmocka_unit_test(a_cleft_is_thin_and_leaves_one_piece),
        cmocka_unit_test(the_plan_holds_the_damage_and_the_damage_the_cleft),
        cmocka_unit_test(the_plan_lies_within_the_cut_budget),
        cmocka_unit_test(a_radial_tear_runs_from_the_inner_margin_outwards),
        cmocka_unit_test(a_flap_is_cut_from_the_margin_and_hangs_on_at_its_end),
        cmocka_unit_test(a_bucket_handle_is_cut_off_along_the_body_but_for_its_ends),
        cmocka_unit_test(a_horizontal_tear_parts_an_upper_from_a_lower_leaf),
        cmocka_unit_test(a_tear_that_does_not_fit_is_refused_by_name),
        cmocka_unit_test(a_plan_never_reaches_into_the_rim),
        cmocka_unit_test(a_left_knee_is_torn_as_the_right_one),
    };
    return cmocka_run_group_tests(tests, make_knees, destroy_knees);
}
