#include "import/judge.h"

#include "case_knee.h"
#include "import/split.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static struct error err;

struct box_surface {
    const char *group;
    vec3 centre, half;
};

static const struct box_surface knee_of_boxes[] = {{"femur", {0, 0, 40}, {40, 30, 40}},
                                                   {"tibia", {2, 0, -45}, {38, 25, 40}},
                                                   {"patella", {0, 45, 40}, {20, 10, 20}},
                                                   {"meniscus_medial", {-20, 0, -2}, {15, 20, 3}},
                                                   {"meniscus_lateral", {20, 0, -2}, {15, 20, 3}}};

#define BOXES 5

static void make_surfaces(struct import_surface *surfaces, double mm_per_unit) {
    for (int i = 0; i < BOXES; i++) {
        struct mesh mesh;
        box_mesh(knee_of_boxes[i].centre, knee_of_boxes[i].half, &mesh);
        surfaces[i] =
            (struct import_surface){knee_of_boxes[i].group, "scan.vtk", 0, pose_identity(), {0}};
        struct import_arrays *arrays = &surfaces[i].arrays;
        arrays->vertex_count = mesh.vertex_count;
        arrays->triangle_count = mesh.triangle_count;
        arrays->triangles = mesh.triangles;
        arrays->positions = malloc(3 * mesh.vertex_count * sizeof(double));
        for (uint32_t k = 0; k < 3 * mesh.vertex_count; k++)
            arrays->positions[k] = (double)mesh.positions[k] / mm_per_unit;
        free(mesh.positions);
    }
}

static void release(struct import_surface *surfaces) {
    for (int i = 0; i < BOXES; i++)
        import_arrays_fini(&surfaces[i].arrays);
}

static void scale_surface(struct import_surface *surface, double factor) {
    for (uint32_t k = 0; k < 3 * surface->arrays.vertex_count; k++)
        surface->arrays.positions[k] *= factor;
}

static void the_unit_is_that_of_the_whole_knee_and_a_mesh_of_another_one_is_named(void **state) {
    (void)state;
    static const char *const names[] = {"mm", "cm", "m"};
    static const double mm[] = {1, 10, 1000};
    struct import_surface surfaces[BOXES];
    struct import_judgement judged;
    for (int i = 0; i < 3; i++) {
        make_surfaces(surfaces, mm[i]);
        assert_ok(import_judge_unit(surfaces, BOXES, &judged, &err));
        assert_string_equal(judged.value, names[i]);
        assert_int_equal(judged.trust, TRUST_SURE);
        assert_near(surfaces[4].mm_per_unit, mm[i], 0);
        scale_surface(&surfaces[4], i == 0 ? 0.001 : mm[i]); // to m, or to mm
        surfaces[4].mm_per_unit = 0;
        assert_int_equal(import_judge_unit(surfaces, BOXES, &judged, &err), RESULT_INVALID);
        assert_non_null(strstr(err.text, "meniscus_lateral disagrees with the bones"));
        assert_non_null(strstr(err.text, i == 0 ? "unit would be m:" : "unit would be mm:"));
        release(surfaces);
    }
    make_surfaces(surfaces, 1);
    for (uint32_t v = 0; v < surfaces[3].arrays.vertex_count; v++)
        surfaces[3].arrays.positions[3 * v] += 300;
    assert_int_equal(import_judge_unit(surfaces, BOXES, &judged, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "meniscus_medial disagrees"));
    release(surfaces);
}

static void axes_and_side_are_those_of_the_knee(void **state) {
    (void)state;
    struct import_surface surfaces[BOXES];
    struct import_judgement judged;
    struct import_frame frame;
    make_surfaces(surfaces, 1);
    assert_ok(import_judge_unit(surfaces, BOXES, &judged, &err));
    assert_ok(import_judge_axes(surfaces, BOXES, &judged, &err));
    assert_string_equal(judged.value, "RAS");
    assert_int_equal(judged.trust, TRUST_SURE);
    assert_true(import_axes("RAS", &frame));
    assert_ok(import_judge_side(surfaces, BOXES, &frame, &judged, &err));
    assert_string_equal(judged.value, "right");
    assert_true(import_axes("LAS", &frame));
    assert_ok(import_judge_side(surfaces, BOXES, &frame, &judged, &err));
    assert_string_equal(judged.value, "left");
    memcpy(surfaces[1].arrays.space, "LPS", 4);
    assert_int_equal(import_judge_axes(surfaces, BOXES, &judged, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "declare the axes LPS, the knee lies as in RAS"));
    surfaces[2].group = "plate"; // without a patella the files are believed
    assert_ok(import_judge_axes(surfaces, BOXES, &judged, &err));
    assert_string_equal(judged.value, "LPS");
    release(surfaces);
}

// Appends a box; there is room for it.
static void join_box(struct import_arrays *out, vec3 centre, vec3 half, bool inwards) {
    struct mesh mesh;
    box_mesh(centre, half, &mesh);
    for (uint32_t k = 0; k < 36; k++)
        out->triangles[3 * out->triangle_count + (inwards ? 35 - k : k)] =
            out->vertex_count + mesh.triangles[k];
    for (uint32_t k = 0; k < 24; k++)
        out->positions[3 * out->vertex_count + k] = (double)mesh.positions[k];
    out->vertex_count += 8;
    out->triangle_count += 12;
    mesh_fini(&mesh);
}

// All boxes in one, and a box that faces inwards within the femur.
static void join_boxes(struct import_arrays *out) {
    *out = (struct import_arrays){.positions = malloc((BOXES + 1) * 24 * sizeof(double)),
                                  .triangles = malloc((BOXES + 1) * 36 * sizeof(uint32_t))};
    join_box(out, knee_of_boxes[0].centre, vec3_scale(0.5, knee_of_boxes[0].half), true);
    for (int i = BOXES - 1; i >= 0; i--)
        join_box(out, knee_of_boxes[i].centre, knee_of_boxes[i].half, false);
}

static struct import_parts split_boxes(struct import_arrays *joined) {
    struct import_parts parts;
    join_boxes(joined);
    assert_ok(import_split(joined, &parts, &err));
    return parts;
}

static void a_file_of_several_parts_is_split_and_its_parts_get_names(void **state) {
    (void)state;
    struct import_arrays joined;
    struct import_frame frame;
    static struct import_parts parts;
    parts = split_boxes(&joined);
    assert_int_equal(parts.count, BOXES);
    assert_int_equal(parts.left_out, 0);
    assert_true(import_axes("RAS", &frame));
    assert_int_equal(import_name_parts(&parts, &frame, NULL, &err), RESULT_MISSING);
    assert_ok(import_name_parts(&parts, &frame, "right", &err));
    uint32_t found = 0;
    for (int i = 0; i < BOXES; i++) {
        for (int k = 0; k < BOXES; k++) {
            if (strcmp(parts.names[i], knee_of_boxes[k].group) != 0)
                continue;
            found |= 1u << k;
            assert_int_equal(parts.parts[i].triangle_count, k == 0 ? 24 : 12);
            assert_int_equal(parts.parts[i].vertex_count, k == 0 ? 16 : 8);
        }
    }
    assert_int_equal(found, 31);
    assert_true(import_axes("RAI", &frame)); // upside down: the other bone is the femur
    assert_ok(import_name_parts(&parts, &frame, "right", &err));
    assert_string_equal(parts.names[0], "tibia");
    import_parts_fini(&parts);
    import_arrays_fini(&joined);
}

static void the_axes_of_a_file_of_several_parts_are_guessed(void **state) {
    (void)state;
    struct import_arrays joined;
    static struct import_parts parts;
    char letters[4];
    parts = split_boxes(&joined);
    import_guess_axes(&parts, letters);
    assert_string_equal(letters, "RAS");
    import_parts_fini(&parts);
    for (uint32_t v = 0; v < joined.vertex_count; v++) { // y up, as glTF has it
        double *p = joined.positions + 3 * (size_t)v, front = p[1];
        p[1] = p[2];
        p[2] = -front;
    }
    assert_ok(import_split(&joined, &parts, &err));
    import_guess_axes(&parts, letters);
    assert_string_equal(letters, "RSP");
    import_parts_fini(&parts);
    import_arrays_fini(&joined);
}

// As files with a normal for each triangle have it: no triangle shares a vertex.
static void take_apart(struct import_arrays *arrays) {
    uint32_t count = 3 * arrays->triangle_count;
    double *positions = malloc(3 * count * sizeof *positions);
    for (uint32_t i = 0; i < count; i++) {
        memcpy(positions + 3 * i, arrays->positions + 3 * arrays->triangles[i], 3 * sizeof(double));
        arrays->triangles[i] = i;
    }
    free(arrays->positions);
    arrays->positions = positions;
    arrays->vertex_count = count;
}

static void assert_splits_into(struct import_arrays *joined, int count) {
    static struct import_parts parts;
    assert_ok(import_split(joined, &parts, &err));
    assert_int_equal(parts.count, count);
    import_parts_fini(&parts);
    import_arrays_fini(joined);
}

static void triangles_that_share_places_are_one_part(void **state) {
    (void)state;
    struct import_arrays joined;
    join_boxes(&joined);
    take_apart(&joined);
    assert_splits_into(&joined, BOXES);
}

static void voids_stay_with_their_bone_in_a_mirrored_file(void **state) {
    (void)state;
    struct import_arrays joined;
    join_boxes(&joined);
    for (uint32_t v = 0; v < joined.vertex_count; v++)
        joined.positions[3 * v] *= -1;
    assert_splits_into(&joined, BOXES);
}

static struct import_arrays row_of_boxes(int count, double apart) {
    struct import_arrays joined = {.positions = malloc((size_t)count * 24 * sizeof(double)),
                                   .triangles = malloc((size_t)count * 36 * sizeof(uint32_t))};
    for (int i = 0; i < count; i++)
        join_box(&joined, (vec3){apart * i, 0, 0}, (vec3){1, 1, 1}, false);
    return joined;
}

static void closed_parts_that_touch_stay_apart(void **state) {
    (void)state;
    struct import_arrays joined = row_of_boxes(3, 2);
    assert_splits_into(&joined, 3);
}

static void too_many_parts_are_refused(void **state) {
    (void)state;
    static struct import_parts parts;
    for (int count = 33; count < 1000; count += 900) {
        struct import_arrays joined = row_of_boxes(count, 3);
        assert_int_equal(import_split(&joined, &parts, &err), RESULT_LIMIT);
        assert_non_null(strstr(err.text, count == 33 ? "33 parts, more" : "933 parts, more"));
        import_parts_fini(&parts);
        import_arrays_fini(&joined);
    }
}

// Cartilage of the femur has a larger area than the tibia.
static void a_bone_is_found_behind_larger_cartilage(void **state) {
    (void)state;
    static const struct box_surface boxes[] = {{"femur", {0, 0, 40}, {40, 30, 40}},
                                               {"part_2", {0, 0, 12}, {60, 50, 8}},
                                               {"tibia", {2, 0, -45}, {38, 25, 40}}};
    struct import_arrays joined = {.positions = malloc(72 * sizeof(double)),
                                   .triangles = malloc(108 * sizeof(uint32_t))};
    static struct import_parts parts;
    struct import_frame frame;
    for (int i = 2; i >= 0; i--)
        join_box(&joined, boxes[i].centre, boxes[i].half, false);
    assert_ok(import_split(&joined, &parts, &err));
    assert_true(import_axes("RAS", &frame));
    assert_ok(import_name_parts(&parts, &frame, "right", &err));
    for (int i = 0; i < 3; i++)
        assert_string_equal(parts.names[i], boxes[i].group);
    import_parts_fini(&parts);
    import_arrays_fini(&joined);
}

// Without menisci and lcl, the mcl shows the side, and not the tibia.
static void the_part_that_shows_the_side_is_named(void **state) {
    (void)state;
    struct import_surface surfaces[BOXES];
    struct import_judgement judged;
    struct import_frame frame;
    make_surfaces(surfaces, 1);
    assert_ok(import_judge_unit(surfaces, BOXES, &judged, &err));
    assert_true(import_axes("RAS", &frame));
    assert_string_equal(surfaces[3].group, "meniscus_medial");
    surfaces[3].group = "mcl";
    surfaces[4].group = "acl";
    assert_ok(import_judge_side(surfaces, BOXES, &frame, &judged, &err));
    assert_string_equal(judged.why, "mcl lies on the side of a right knee; 1 of such pairs agree");
    surfaces[2].group = "mcl"; // medial of the tibia's middle by 2 mm
    surfaces[3].group = "fibula";
    assert_int_equal(import_judge_side(surfaces, BOXES, &frame, &judged, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "fibula lies as in a left knee, mcl as in a right one"));
    release(surfaces);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_unit_is_that_of_the_whole_knee_and_a_mesh_of_another_one_is_named),
        cmocka_unit_test(a_file_of_several_parts_is_split_and_its_parts_get_names),
        cmocka_unit_test(the_axes_of_a_file_of_several_parts_are_guessed),
        cmocka_unit_test(triangles_that_share_places_are_one_part),
        cmocka_unit_test(voids_stay_with_their_bone_in_a_mirrored_file),
        cmocka_unit_test(closed_parts_that_touch_stay_apart),
        cmocka_unit_test(too_many_parts_are_refused),
        cmocka_unit_test(a_bone_is_found_behind_larger_cartilage),
        cmocka_unit_test(axes_and_side_are_those_of_the_knee),
        cmocka_unit_test(the_part_that_shows_the_side_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
