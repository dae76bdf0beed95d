// Worn cartilage: where a patch puts its grades, and that files, parts and finer meshes keep them.
#include "generate/wear.h"

#include "case_knee.h"
#include "generate/generate.h"
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

static void what_nothing_of_wears_is_told(void **state) {
    (void)state;
    struct knee_case *knee = plate_knee();
    struct case_group *tibia = case_group(knee, "tibia");
    tibia->tissue.kind = TISSUE_SYNOVIUM;
    assert_int_equal(wear(knee, (struct wear_patch){{0, 0, 0}, 6, 4}), RESULT_MISSING);
    assert_non_null(strstr(err.text, "neither bone nor cartilage"));
    tibia->tissue.kind = TISSUE_BONE;
    tibia->cuttable = true;
    assert_int_equal(wear(knee, (struct wear_patch){{0, 0, 0}, 6, 4}), RESULT_MISSING);
    assert_null(tibia->wear);
    case_destroy(&knee);
}

// A bone below cartilage of another kind, which hides it.
static void what_is_hidden_is_no_wear(void **state) {
    (void)state;
    struct knee_case *knee = plate_knee();
    struct case_group *tibia = case_group(knee, "tibia");
    float *covered = case_group_need_covered(tibia);
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++)
        covered[v] = vec3_length(mesh_vertex(&tibia->mesh, v)) < 7;
    assert_int_equal(wear(knee, (struct wear_patch){{0, 0, 0}, 6, 4}), RESULT_MISSING);
    assert_null(tibia->wear);
    assert_ok(wear(knee, (struct wear_patch){{2, 0, 0}, 6, 4}));
    case_destroy(&knee);
}

// A flap of cartilage that instruments take off, over a bone that wears.
static void what_can_be_cut_stays_whole(void **state) {
    (void)state;
    struct knee_case *knee = plate_knee();
    struct case_group *flap = case_group(knee, "meniscus_medial");
    flap->tissue.kind = TISSUE_CARTILAGE;
    flap->cuttable = true;
    assert_ok(wear(knee, (struct wear_patch){{0, 0, 0}, 6, 4}));
    assert_non_null(case_group(knee, "tibia")->wear);
    assert_null(flap->wear);
    flap->cuttable = false;
    assert_ok(wear(knee, (struct wear_patch){{0, 0, 0}, 6, 4}));
    assert_non_null(flap->wear);
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
    assert_non_null(strstr(err.text, "cuttable, so nothing of it can be worn"));
    case_destroy(&knee);
    knee = box_knee();
    case_group_need_wear(case_group(knee, "lcl"));
    assert_int_equal(case_validate(knee, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "lcl is neither bone nor cartilage"));
    case_destroy(&knee);
}

static void a_tissue_of_another_kind_is_whole(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct pathology step;
    pathology_init(&step, PATHOLOGY_TISSUE, "patella");
    case_group_need_wear(case_group(knee, "patella"))[0] = 3;
    assert_ok(pathology_take(&step, "label", "A kneecap", &err));
    assert_ok(pathology_apply(knee, &step, 1, &err));
    assert_non_null(case_group(knee, "patella")->wear);
    assert_ok(pathology_take(&step, "kind", "other", &err));
    assert_ok(pathology_apply(knee, &step, 1, &err));
    assert_null(case_group(knee, "patella")->wear);
    case_destroy(&knee);
}

// A part without wear, beside one that has it.
static void parts_without_wear_are_whole(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct case_group *tibia = case_group(knee, "tibia");
    uint32_t before = tibia->mesh.vertex_count;
    case_group_need_wear(tibia)[before - 1] = 2;
    struct mesh box;
    box_mesh((vec3){18, 0, -21}, (vec3){14, 20, 1}, &box);
    assert_ok(case_add_part(tibia, "lateral", &box, &err));
    mesh_fini(&box);
    assert_near((double)tibia->wear[before - 1], 2, 0);
    for (uint32_t v = before; v < tibia->mesh.vertex_count; v++)
        assert_near((double)tibia->wear[v], 0, 0);
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

// ---- a recipe's ---------------------------------------------------------------------------------

static const struct recipe coarse = {.name = "worn",
                                     .title = "Worn",
                                     .size = 1,
                                     .resolution_mm = 3,
                                     .meniscus_medial_cm3 = 2.4,
                                     .meniscus_lateral_cm3 = 2.4};

// The middle of what has the worst grade, from the joint's origin, x lateral.
static vec3 worst_place(struct recipe recipe, const char *body, const char *at) {
    struct pathology *step = &recipe.steps[recipe.step_count++];
    struct knee_case *knee;
    pathology_init(step, PATHOLOGY_WEAR, "a");
    assert_ok(pathology_take(step, "body", body, &err));
    assert_ok(pathology_take(step, "at", at, &err));
    assert_ok(pathology_take(step, "radius_mm", "12", &err));
    assert_ok(pathology_take(step, "grade", "3", &err));
    if (generate_knee(&recipe, &knee, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    const struct case_group *group = case_group(knee, body);
    vec3 sum = {0};
    int count = 0;
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++)
        if (group->wear[v] == 3) {
            sum = vec3_add(sum, mesh_vertex(&group->mesh, v));
            count++;
        }
    pose joint = group->body == BODY_TIBIA ? knee->joint.T_tibia_joint : knee->joint.T_femur_joint;
    vec3 middle = pose_apply(pose_inverse(joint), vec3_scale(1.0 / count, sum));
    if (knee->joint.side == SIDE_LEFT)
        middle.x = -middle.x;
    case_destroy(&knee);
    return middle;
}

static void a_place_goes_with_the_size_and_the_side(void **state) {
    (void)state;
    struct recipe small = coarse, left = coarse;
    small.size = 0.8;
    left.side = SIDE_LEFT;
    vec3 usual = worst_place(coarse, "tibia", "-20 0 -18");
    assert_true(usual.x < -14 && usual.x > -26);
    assert_vec3_near(worst_place(left, "tibia", "-20 0 -18"), usual, 1e-3);
    assert_vec3_near(worst_place(small, "tibia", "-20 0 -18"), vec3_scale(0.8, usual), 1.5);
}

static void a_landmark_is_a_place(void **state) {
    (void)state;
    struct knee_case *knee = plate_knee();
    struct pathology step;
    knee->landmarks[knee->landmark_count++] =
        (struct case_landmark){.name = "plateau_medial", .body = BODY_TIBIA, .at = {-4, 3, 0}};
    pathology_init(&step, PATHOLOGY_WEAR, "a");
    assert_ok(pathology_take(&step, "body", "tibia", &err));
    assert_ok(pathology_take(&step, "at", "plateau_medial", &err));
    assert_ok(pathology_take(&step, "radius_mm", "4", &err));
    assert_ok(pathology_take(&step, "grade", "3", &err));
    assert_ok(pathology_apply(knee, &step, 1, &err));
    const struct case_group *tibia = case_group(knee, "tibia");
    assert_near((double)tibia->wear[mesh_nearest_vertex(&tibia->mesh, (vec3){-4, 3, 0})], 3, 0);
    assert_near((double)tibia->wear[mesh_nearest_vertex(&tibia->mesh, (vec3){0, 0, 0})], 0, 0);
    strcpy(knee->landmarks[0].name, "plateau_lateral");
    assert_int_equal(pathology_apply(knee, &step, 1, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "no landmark plateau_medial"));
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
        cmocka_unit_test(what_nothing_of_wears_is_told),
        cmocka_unit_test(what_is_hidden_is_no_wear),
        cmocka_unit_test(a_tissue_of_another_kind_is_whole),
        cmocka_unit_test(what_can_be_cut_stays_whole),
        cmocka_unit_test(a_case_keeps_wear_part_by_part),
        cmocka_unit_test(parts_without_wear_are_whole),
        cmocka_unit_test(grades_that_there_are_not_are_refused),
        cmocka_unit_test(new_vertices_are_worn_as_their_neighbours),
        cmocka_unit_test(a_place_goes_with_the_size_and_the_side),
        cmocka_unit_test(a_landmark_is_a_place),
        cmocka_unit_test(words_of_wear_are_bounded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
