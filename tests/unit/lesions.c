#include "scene/lesions.h"

#include "base/check.h"
#include "generated.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static struct knee_case *knee;

static int make_knee(void **state) {
    (void)state;
    knee = generated_knee(CASES "/healthy");
    return 0;
}

static int destroy_knee(void **state) {
    (void)state;
    case_destroy(&knee);
    return 0;
}

static double length_at(const struct case_group *group, uint32_t v) {
    const float *w = group->warp + 3 * (size_t)v;
    return vec3_length((vec3){(double)w[0], (double)w[1], (double)w[2]});
}

static double longest(const struct case_group *group) {
    double most = 0;
    for (uint32_t v = 0; group->warp && v < group->mesh.vertex_count; v++)
        most = fmax(most, length_at(group, v));
    return most;
}

static void make(enum lesion lesion, uint64_t seed) {
    struct error err;
    assert_int_equal(lesion_make(knee, lesion, seed, &err), RESULT_OK);
}

// What is displaced by how much, and that nothing else is.
static void each_lesion_displaces_its_groups_by_its_depth(void **state) {
    (void)state;
    static const struct {
        const char *groups[2];
        double least_mm, most_mm; // of the longest displacement
    } rows[LESION_COUNT] = {
        [LESION_CAVITY] = {{"tibia", "meniscus_medial"}, 2.69, 3.31},
        [LESION_UNDER_MENISCUS] = {{"tibia", "meniscus_medial"}, 2.69, 3.31},
        [LESION_BUMP] = {{"femur", "femur"}, 1.34, 1.66},
        [LESION_TRIMMED] = {{"meniscus_medial", "meniscus_medial"}, 3, 12},
        [LESION_NOTCH] = {{"femur", "femur"}, 1.79, 2.21},
    };
    for (int l = 0; l < LESION_COUNT; l++)
        for (uint64_t seed = 1; seed < 4; seed++) {
            double most = 0;
            make((enum lesion)l, seed);
            for (int i = 0; i < knee->group_count; i++) {
                const struct case_group *group = &knee->groups[i];
                bool named = strcmp(group->name, rows[l].groups[0]) == 0 ||
                             strcmp(group->name, rows[l].groups[1]) == 0;
                assert_true(named || longest(group) == 0);
                most = fmax(most, longest(group));
            }
            assert_true(most >= rows[l].least_mm && most <= rows[l].most_mm);
        }
}

static void a_meniscus_sinks_with_the_cavity_below_it(void **state) {
    (void)state;
    make(LESION_UNDER_MENISCUS, 1);
    assert_true(longest(case_group(knee, "meniscus_medial")) > 1);
}

static void a_bump_goes_outwards(void **state) {
    (void)state;
    for (int l = LESION_BUMP; l <= LESION_NOTCH; l += LESION_NOTCH - LESION_BUMP) {
        make((enum lesion)l, 1);
        struct mesh mesh;
        const struct case_group *femur = case_group(knee, "femur");
        case_group_virtual(femur, &mesh);
        assert_true(mesh_volume(&mesh) > mesh_volume(&femur->mesh) + 5);
        mesh_fini(&mesh);
    }
}

static void a_trimmed_meniscus_goes_a_part_of_the_way_to_its_maxcut(void **state) {
    (void)state;
    make(LESION_TRIMMED, 1);
    const struct case_group *group = case_group(knee, "meniscus_medial");
    uint32_t partly = 0;
    for (size_t i = 0; i < 3 * (size_t)group->mesh.vertex_count; i += 3) {
        double m = (double)group->maxcut[i], w = (double)group->warp[i];
        assert_true(w * m >= 0 && fabs(w) <= fabs(m) * (1 + 1e-6));
        partly += fabs(w) > 0.05 * fabs(m) && fabs(w) < 0.95 * fabs(m);
    }
    assert_true(partly > 10);
    struct mesh mesh;
    case_group_virtual(group, &mesh);
    assert_true(mesh_volume(&mesh) < mesh_volume(&group->mesh) - 10);
    mesh_fini(&mesh);
}

static void a_seed_is_the_same_lesion_and_another_seed_another(void **state) {
    (void)state;
    const struct case_group *tibia = case_group(knee, "tibia");
    size_t size = 3 * sizeof(float) * tibia->mesh.vertex_count;
    float *first = alloc(size, 1);
    make(LESION_CAVITY, 1);
    memcpy(first, tibia->warp, size);
    make(LESION_NOTCH, 5);
    make(LESION_CAVITY, 1);
    assert_memory_equal(first, tibia->warp, size);
    make(LESION_CAVITY, 2);
    assert_memory_not_equal(first, tibia->warp, size);
    free(first);
}

static void a_knee_without_the_place_is_told_so(void **state) {
    (void)state;
    struct error err;
    struct case_group *meniscus = case_group(knee, "meniscus_medial");
    float *maxcut = meniscus->maxcut;
    meniscus->maxcut = NULL;
    assert_int_equal(lesion_make(knee, LESION_TRIMMED, 1, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "maxcut"));
    meniscus->maxcut = maxcut;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_lesion_displaces_its_groups_by_its_depth),
        cmocka_unit_test(a_meniscus_sinks_with_the_cavity_below_it),
        cmocka_unit_test(a_bump_goes_outwards),
        cmocka_unit_test(a_trimmed_meniscus_goes_a_part_of_the_way_to_its_maxcut),
        cmocka_unit_test(a_seed_is_the_same_lesion_and_another_seed_another),
        cmocka_unit_test(a_knee_without_the_place_is_told_so),
    };
    return cmocka_run_group_tests(tests, make_knee, destroy_knee);
}
