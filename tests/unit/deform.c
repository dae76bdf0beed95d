#include "generate/deform.h"

#include "test.h"

#include <string.h>

static struct error err;

#define SIDE_VERTICES 81

// A plate in z = height, 80 by 80 mm, facing up, with a vertex each millimetre.
static void plate(double height, struct mesh *out_mesh) {
    mesh_init(out_mesh, SIDE_VERTICES * SIDE_VERTICES,
              2 * (SIDE_VERTICES - 1) * (SIDE_VERTICES - 1));
    uint32_t *t = out_mesh->triangles;
    for (uint32_t i = 0; i < SIDE_VERTICES; i++) {
        for (uint32_t k = 0; k < SIDE_VERTICES; k++) {
            uint32_t v = i * SIDE_VERTICES + k;
            mesh_set_vertex(out_mesh, v, (vec3){(double)i - 40, (double)k - 40, height});
            if (i + 1 == SIDE_VERTICES || k + 1 == SIDE_VERTICES)
                continue;
            uint32_t corners[6] = {v, v + SIDE_VERTICES,     v + SIDE_VERTICES + 1,
                                   v, v + SIDE_VERTICES + 1, v + 1};
            memcpy(t, corners, sizeof corners);
            t += 6;
        }
    }
}

static struct knee_case *plates(void) {
    struct knee_case *knee = case_create("plates", "");
    struct case_group *tibia = case_add_group(knee, "tibia", BODY_TIBIA);
    struct mesh mesh;
    plate(0, &mesh);
    assert_int_equal(case_add_part(tibia, "cartilage", &mesh, &err), RESULT_OK);
    mesh_fini(&mesh);
    plate(-2, &mesh);
    assert_int_equal(case_add_part(tibia, "bone", &mesh, &err), RESULT_OK);
    mesh_fini(&mesh);
    return knee;
}

static vec3 warp_of(const struct case_group *group, uint32_t v) {
    const float *w = group->warp + 3 * (size_t)v;
    return (vec3){(double)w[0], (double)w[1], (double)w[2]};
}

static void a_cavity_is_exactly_as_deep_and_as_wide_as_asked(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    struct deform_cavity cavity = {{5.2, -7.1, 0.3}, 10, 3};
    assert_int_equal(deform_cavity_add(&tibia, 1, &cavity, &err), RESULT_OK);
    vec3 middle = {5, -7, 0};
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++) {
        double d = vec3_distance(mesh_vertex(&tibia->mesh, v), middle), t = d / 10;
        double depth = d < 10 ? 3 * pow(1 - t * t, 3) : 0;
        assert_vec3_near(warp_of(tibia, v), ((vec3){0, 0, -depth}), 1e-6);
        if (d == 0)
            assert_true(warp_of(tibia, v).z == -3);
        if (d >= 10)
            assert_true(vec3_length(warp_of(tibia, v)) == 0);
    }
    case_destroy(&knee);
}

static void parts_that_lie_on_one_another_keep_their_order(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    struct deform_cavity cavity = {{0, 0, 0}, 10, 5}, beside = {{4, 0, 0}, 10, 5};
    assert_int_equal(deform_cavity_add(&tibia, 1, &cavity, &err), RESULT_OK);
    assert_int_equal(deform_cavity_add(&tibia, 1, &beside, &err), RESULT_OK);
    uint32_t below = tibia->parts[1].first_vertex;
    for (uint32_t v = 0; v < below; v++) {
        double gap = 2 + warp_of(tibia, v).z - warp_of(tibia, v + below).z;
        assert_true(gap > 0.2 && gap < 4);
    }
    case_destroy(&knee);
}

static void dents_that_overlap_go_deeper_from_where_the_first_left_off(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    struct deform_cavity cavity = {{0, 0, 0}, 10, 3};
    for (int i = 0; i < 3; i++)
        assert_int_equal(deform_cavity_add(&tibia, 1, &cavity, &err), RESULT_OK);
    assert_near(warp_of(tibia, 40 * SIDE_VERTICES + 40).z, -9, 1e-6);
    case_destroy(&knee);
}

static void further_groups_follow_the_same_map(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct mesh mesh;
    plate(1, &mesh);
    struct case_group *above = case_add_group(knee, "meniscus_medial", BODY_TIBIA);
    assert_int_equal(case_add_part(above, "m", &mesh, &err), RESULT_OK);
    struct case_group *groups[] = {&knee->groups[0], above};
    struct deform_cavity cavity = {{0, 0, 0}, 10, 3};
    assert_int_equal(deform_cavity_add(groups, 2, &cavity, &err), RESULT_OK);
    assert_near(warp_of(above, 40 * SIDE_VERTICES + 40).z, -3 * pow(0.99, 3), 1e-6);
    mesh_fini(&mesh);
    case_destroy(&knee);
}

static void a_cavity_that_would_fold_or_hits_nothing_is_refused_and_changes_nothing(void **state) {
    (void)state;
    static const struct {
        struct deform_cavity cavity;
        const char *says;
    } rows[] = {
        {{{0, 0, 0}, 10, 5.01}, "would fold"}, {{{0, 0, 0}, 10, 0}, "depth"},
        {{{0, 0, 0}, 10, -3}, "depth"},        {{{0, 0, 0}, 0, 1}, "radius"},
        {{{0, 0, 0}, 101, 1}, "radius"},       {{{0, 0, NAN}, 10, 3}, "not finite"},
        {{{0, 0, 6}, 10, 3}, "6.0 mm away"},   {{{0, 0, 0}, NAN, 3}, "radius"},
    };
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(deform_cavity_add(&tibia, 1, &rows[i].cavity, &err), RESULT_INVALID);
        if (!strstr(err.text, rows[i].says))
            fail_msg("\"%s\" does not say \"%s\"", err.text, rows[i].says);
        assert_null(tibia->warp);
    }
    case_destroy(&knee);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cavity_is_exactly_as_deep_and_as_wide_as_asked),
        cmocka_unit_test(parts_that_lie_on_one_another_keep_their_order),
        cmocka_unit_test(dents_that_overlap_go_deeper_from_where_the_first_left_off),
        cmocka_unit_test(further_groups_follow_the_same_map),
        cmocka_unit_test(a_cavity_that_would_fold_or_hits_nothing_is_refused_and_changes_nothing),
    };
    return cmocka_run_group_tests_name("deform", tests, NULL, NULL);
}
