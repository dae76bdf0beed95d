// Worn cartilage: where a patch puts its grades, and that files, parts and finer meshes keep them.
#include "generate/wear.h"

#include "case_knee.h"
#include "generate/pathology.h"
#include "generate/refine.h"
#include "test.h"

#include <string.h>

static struct error err;

// A plate of 41 x 41 vertices every 0.5 mm round the origin, of a knee that has a meniscus too.
static struct knee_case *plate_knee(void) {
    enum { SIDE = 41 };
    struct knee_case *knee = case_create("plate", "");
    struct mesh plate, box;
    mesh_init(&plate, SIDE * SIDE, 2 * (SIDE - 1) * (SIDE - 1));
    for (uint32_t v = 0; v < SIDE * SIDE; v++)
        mesh_set_vertex(&plate, v, (vec3){0.5 * (v % SIDE) - 10, 0.5 * (v / SIDE) - 10, 0});
    for (uint32_t row = 0, at = 0; row + 1 < SIDE; row++)
        for (uint32_t column = 0; column + 1 < SIDE; column++, at += 6) {
            uint32_t a = SIDE * row + column, b = a + SIDE;
            memcpy(plate.triangles + at, (uint32_t[]){a, a + 1, b, b, a + 1, b + 1},
                   6 * sizeof *plate.triangles);
        }
    assert_ok(case_add_part(case_add_group(knee, "tibia", BODY_TIBIA), "tibia", &plate, &err));
    box_mesh((vec3){0, 0, 2}, (vec3){3, 3, 1}, &box);
    assert_ok(case_add_part(case_add_group(knee, "meniscus_medial", BODY_TIBIA), "meniscus_medial",
                            &box, &err));
    mesh_fini(&plate);
    mesh_fini(&box);
    return knee;
}

static enum result wear(struct knee_case *knee, struct wear_patch patch) {
    struct case_group *groups[] = {case_group(knee, "tibia"), case_group(knee, "meniscus_medial")};
    return wear_add(groups, 2, &patch, &err);
}

static void the_grade_holds_to_half_of_the_radius_and_falls_to_nothing(void **state) {
    (void)state;
    struct knee_case *knee = plate_knee();
    assert_ok(wear(knee, (struct wear_patch){{2.1, 1.1, 0.3}, 6, 3}));
    const struct case_group *tibia = case_group(knee, "tibia");
    const vec3 middle = {2, 1, 0}; // the nearest vertex
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++) {
        double distance = vec3_distance(mesh_vertex(&tibia->mesh, v), middle);
        double grade = (double)tibia->wear[v];
        if (distance <= 3)
            assert_near(grade, 3, 0);
        else if (distance >= 6)
            assert_near(grade, 0, 0);
        else
            assert_true(grade > 0 && grade < 3);
        for (uint32_t u = v + 1; u < tibia->mesh.vertex_count && u < v + 60; u++)
            if (vec3_distance(mesh_vertex(&tibia->mesh, u), middle) > distance)
                assert_true((double)tibia->wear[u] <= grade);
    }
    assert_null(case_group(knee, "meniscus_medial")->wear);
    case_destroy(&knee);
}

static void a_second_patch_never_makes_cartilage_better(void **state) {
    (void)state;
    struct knee_case *knee = plate_knee();
    assert_ok(wear(knee, (struct wear_patch){{0, 0, 0}, 6, 4}));
    assert_ok(wear(knee, (struct wear_patch){{4, 0, 0}, 6, 1}));
    const struct case_group *tibia = case_group(knee, "tibia");
    uint32_t middle = mesh_nearest_vertex(&tibia->mesh, (vec3){0, 0, 0});
    uint32_t beyond = mesh_nearest_vertex(&tibia->mesh, (vec3){6.5, 0, 0});
    assert_near((double)tibia->wear[middle], 4, 0);
    assert_near((double)tibia->wear[beyond], 1, 0);
    case_destroy(&knee);
}

static void wear_beside_the_bone_is_refused(void **state) {
    (void)state;
    struct knee_case *knee = plate_knee();
    assert_int_equal(wear(knee, (struct wear_patch){{0, 0, 3.5}, 6, 4}), RESULT_INVALID);
    assert_non_null(strstr(err.text, "3.5 mm away"));
    assert_null(case_group(knee, "tibia")->wear);
    case_destroy(&knee);
}

// ---- a case's -----------------------------------------------------------------------------------

static void a_case_keeps_wear_part_by_part(void **state) {
    (void)state;
    char folder[FOLDER_MAX];
    folder_make(folder);
    struct knee_case *knee = box_knee(), *read;
    struct case_group *tibia = case_group(knee, "tibia");
    float *grades = case_group_need_wear(tibia);
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++)
        grades[v] = 4 * (float)v / (float)tibia->mesh.vertex_count;
    assert_ok(case_save(knee, folder, &err));
    assert_ok(case_load(folder, NULL, &read, &err));
    assert_memory_equal(case_group(read, "tibia")->wear, grades,
                        tibia->mesh.vertex_count * sizeof *grades);
    assert_null(case_group(read, "femur")->wear);
    case_destroy(&read);
    case_destroy(&knee);
    folder_remove(folder);
}

static void grades_that_there_are_not_are_refused(void **state) {
    (void)state;
    static const float wrong[] = {-0.1f, 4.1f, NAN, INFINITY};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct knee_case *knee = box_knee();
        case_group_need_wear(case_group(knee, "femur"))[2] = wrong[i];
        assert_int_equal(case_validate(knee, &err), RESULT_INVALID);
        assert_non_null(strstr(err.text, "wear of vertex 2"));
        case_destroy(&knee);
    }
    struct knee_case *knee = box_knee();
    case_group_need_wear(case_group(knee, "meniscus_medial"));
    assert_int_equal(case_validate(knee, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "nothing of it can be worn"));
    case_destroy(&knee);
}

static vec3 down(const void *context, vec3 p) {
    (void)context;
    return (vec3){0, 0, -fmax(0, 3 - 0.5 * vec3_length(p))};
}

static void new_vertices_are_worn_as_their_neighbours(void **state) {
    (void)state;
    static const float corners[] = {-12, -9, 0, 12, -9, 0, 0, 14, 0};
    static const uint32_t corner[] = {0, 1, 2};
    struct mesh one = {3, 1, (float *)corners, (uint32_t *)corner};
    struct knee_case *knee = case_create("one", "");
    struct case_group *tibia = case_add_group(knee, "tibia", BODY_TIBIA);
    assert_ok(case_add_part(tibia, "tibia", &one, &err));
    memcpy(case_group_need_wear(tibia), (float[]){1, 3, 2}, 3 * sizeof(float));
    refine_group(tibia, &(struct refine_map){down, NULL, {0}, 10});
    assert_true(tibia->mesh.vertex_count > 20);
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++) {
        vec3 p = mesh_vertex(&tibia->mesh, v);
        assert_near((double)tibia->wear[v], 2 + p.x / 12, 1e-4); // linear between 1, 3 and 2
    }
    case_destroy(&knee);
}

// ---- words --------------------------------------------------------------------------------------

static void words_of_wear_are_bounded(void **state) {
    (void)state;
    struct pathology step;
    pathology_init(&step, PATHOLOGY_WEAR, "");
    assert_int_equal(pathology_check(&step, &err), RESULT_MISSING);
    assert_ok(pathology_take(&step, "body", "patella", &err));
    assert_ok(pathology_take(&step, "at", "1 -2 3.5", &err));
    assert_ok(pathology_take(&step, "radius_mm", "8", &err));
    assert_int_equal(pathology_take(&step, "grade", "0.5", &err), RESULT_INVALID);
    assert_int_equal(pathology_take(&step, "grade", "5", &err), RESULT_INVALID);
    assert_int_equal(pathology_take(&step, "depth_mm", "2", &err), RESULT_INVALID);
    assert_ok(pathology_take(&step, "grade", "2.5", &err));
    assert_ok(pathology_check(&step, &err));
    assert_int_equal(step.wear.place.body, BODY_PATELLA);
    assert_near(step.wear.grade, 2.5, 0);
    assert_vec3_near(step.wear.place.at, ((vec3){1, -2, 3.5}), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_grade_holds_to_half_of_the_radius_and_falls_to_nothing),
        cmocka_unit_test(a_second_patch_never_makes_cartilage_better),
        cmocka_unit_test(wear_beside_the_bone_is_refused),
        cmocka_unit_test(a_case_keeps_wear_part_by_part),
        cmocka_unit_test(grades_that_there_are_not_are_refused),
        cmocka_unit_test(new_vertices_are_worn_as_their_neighbours),
        cmocka_unit_test(words_of_wear_are_bounded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
